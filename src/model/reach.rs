//! How far away a point may be and still matter to a decision.

/// What a method promises about the neighbourhood its decisions depend on; the halo of tiles follows from it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reach {
    /// The decision for a point (ground: its class; clustering: which pairs it is joined with) depends only on points
    /// within this horizontal distance, so that after stitching tiled equals untiled bit for bit.
    Exact {
        /// Horizontal distance in metres.
        metres: f64,
    },
    /// An iterative or global method that only converges with distance; tile cores agree to at least `tolerance`.
    Settling {
        /// Horizontal distance in metres.
        metres: f64,
        /// Share of points (0 to 1) that agree with the untiled result at least.
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
