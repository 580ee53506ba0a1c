"""One step of the density in time, and its adjoint.

Cells that no impact can reach move in free flight (`free_flight`: exact shears along mesh lines, prepared by `shifts`).
From all others every Gauss point sends paths that carry the noise through impacts (`noise_paths`), which land in cells
(`landing`) where their mass is set down (`deposit`). `step` puts both together.
"""
