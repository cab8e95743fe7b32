//! How well a sheet keeps the mix and the minimum clusters.
