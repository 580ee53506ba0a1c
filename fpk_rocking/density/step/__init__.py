"""One step of the density in time, and its adjoint: `step` puts together free flight, characteristics and scatter."""
