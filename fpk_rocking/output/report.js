"use strict";

const film = JSON.parse(document.getElementById("film").textContent);
const slider = document.getElementById("cycle");
const MARGIN = { left: 62, right: 16, top: 8, bottom: 46 };

function ticks(low, high) {
  const rough = (high - low) / 5;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find((factor) => factor * power >= rough);
  const found = [];
  for (let k = Math.ceil(low / step); k * step <= high; k += 1) found.push(k * step);
  return found;
}

function draw(n, row) {
  const one = film.films[n];
  const canvas = document.getElementById(`film${n}`);
  const pen = canvas.getContext("2d");
  const codes = atob(one.codes[row]);
  const { angle, velocity } = film;
  const columns = angle.length - 1;
  const rows = velocity.length - 1;
  const right = canvas.width - MARGIN.right;
  const bottom = canvas.height - MARGIN.bottom;
  const x = (value) => MARGIN.left + ((right - MARGIN.left) * (value - angle[0])) / (angle[columns] - angle[0]);
  const y = (value) => bottom - ((bottom - MARGIN.top) * (value - velocity[0])) / (velocity[rows] - velocity[0]);

  pen.fillStyle = "#ffffff";
  pen.fillRect(0, 0, canvas.width, canvas.height);
  for (let i = 0; i < columns; i += 1) {
    for (let j = 0; j < rows; j += 1) {
      pen.fillStyle = film.colours[codes.charCodeAt(i * rows + j)];
      // Half a pixel more, so that no seam shows between cells.
      pen.fillRect(x(angle[i]), y(velocity[j + 1]), x(angle[i + 1]) - x(angle[i]) + 0.5, y(velocity[j]) - y(velocity[j + 1]) + 0.5);
    }
  }
  pen.fillStyle = film.overturned;
  one.overturned[row].forEach((part, side) => {
    const height = part * (bottom - MARGIN.top);
    pen.fillRect(side === 0 ? MARGIN.left - 10 : right + 2, bottom - height, 8, height);
  });
  pen.fillStyle = "#222222";
  pen.font = "13px sans-serif";
  pen.textAlign = "center";
  ticks(angle[0], angle[columns]).forEach((value) => pen.fillText(Number(value.toPrecision(3)), x(value), bottom + 16));
  pen.fillText(film.names[0], (MARGIN.left + right) / 2, bottom + 36);
  pen.textAlign = "right";
  ticks(velocity[0], velocity[rows]).forEach((value) => pen.fillText(Number(value.toPrecision(3)), MARGIN.left - 14, y(value) + 4));
  pen.save();
  pen.translate(13, (MARGIN.top + bottom) / 2);
  pen.rotate(-Math.PI / 2);
  pen.textAlign = "center";
  pen.fillText(film.names[1], 0, 0);
  pen.restore();

  const [left, other] = one.overturned[row].map((part) => part.toFixed(4));
  const said = `survival ${one.survival[row].toFixed(4)}, overturned left ${left}, right ${other}`;
  document.getElementById(`said${n}`).textContent = said;
  canvas.setAttribute("aria-label", `Density ${film.when[row]}: ${said}`);
}

function show() {
  const row = Number(slider.value);
  document.getElementById("when").textContent = film.when[row];
  document.getElementById("most").textContent = film.most[row].toPrecision(3);
  film.films.forEach((_, n) => draw(n, row));
}

slider.addEventListener("input", show);
show();
