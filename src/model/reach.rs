//! The distance within which a point can matter to a decision.

/// What a method promises about the neighbourhood that its decisions depend on. The halo of a tile follows
/// from it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reach {
    /// The decision for a point depends only on points within this horizontal distance. For a ground filter
    /// it is the class, for clustering the pairs that are joined. After stitching, the tiled result equals
    /// the untiled one bit for bit.
    Exact {
        /// Horizontal distance in metres.
        metres: f64,
    },
    /// An iterative or global method whose result only converges with distance. In tile cores, at least the
    /// share `tolerance` of the points agrees with the untiled result.
    Settling {
        /// Horizontal distance in metres.
        metres: f64,
        /// Smallest share of points (0 to 1) that agree with the untiled result.
        tolerance: f64,
    },
}

impl Reach {
    /// Horizontal distance in metres.
    #[must_use]
    pub fn metres(self) -> f64 {
        match self {
            Self::Exact { metres } | Self::Settling { metres, .. } => metres,
        }
    }
}
