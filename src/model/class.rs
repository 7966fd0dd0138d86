//! What a point is before it is part of an object: one byte per point of the drive.

/// Class of a point after the ground pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
#[repr(u8)]
pub enum PointClass {
    /// Neither ground nor noise: the points of objects.
    #[default]
    Object = 0,
    /// Ground (LAS class 2).
    Ground = 1,
    /// Isolated noise, below or near the ground (LAS class 7).
    LowNoise = 2,
    /// Isolated noise, high above the lowest other points (LAS class 18, or 7 where the format has no 18).
    HighNoise = 3,
    /// Withheld in the input: "should not be included in processing, synonymous with deleted" (LAS 1.4 R15,
    /// tables 8 and 16).
    Withheld = 4,
}

impl PointClass {
    /// Number of classes.
    pub const COUNT: usize = 5;
    /// The code of a point whose class was not decided, because it lies outside the section of the drive that
    /// is processed.
    pub const UNDECIDED: u8 = u8::MAX;

    /// The class stored as `code`; `None` when no class has this code.
    #[must_use]
    pub fn from_code(code: u8) -> Option<Self> {
        Some(match code {
            0 => Self::Object,
            1 => Self::Ground,
            2 => Self::LowNoise,
            3 => Self::HighNoise,
            4 => Self::Withheld,
            _ => return None,
        })
    }

    /// The byte this class is stored as.
    #[must_use]
    pub fn code(self) -> u8 {
        self as u8
    }

    /// Whether the point is isolated noise, high or low.
    #[must_use]
    pub fn is_noise(self) -> bool {
        matches!(self, Self::LowNoise | Self::HighNoise)
    }
}
