//! Least squares on the simplex, and equation 1 in the perceptual metric.
