//! Distances that options state or leave to the photons.

/// Value of an option: metres, or `auto`.
#[derive(Clone, Copy)]
pub(super) enum Distance {
    Auto,
    Metres(f32),
}

impl Distance {
    /// Reads a greatest distance, which is positive.
    pub(super) fn greatest(text: &str) -> Result<Self, String> {
        let error = "a greatest distance is a positive number of metres, or auto";
        Self::parse(text, |metres| metres > 0.0).ok_or_else(|| error.to_owned())
    }

    /// Reads a length below which gather rays go on; 0 for none.
    pub(super) fn near(text: &str) -> Result<Self, String> {
        let error = "a length is a number of metres, 0 or more, or auto";
        Self::parse(text, |metres| metres >= 0.0).ok_or_else(|| error.to_owned())
    }

    fn parse(text: &str, is_distance: impl FnOnce(f32) -> bool) -> Option<Self> {
        if text == "auto" {
            return Some(Self::Auto);
        }
        let metres = text.parse().ok().filter(|metres: &f32| metres.is_finite())?;
        is_distance(metres).then_some(Self::Metres(metres))
    }

    /// Metres, if they are stated.
    pub(super) fn stated(self) -> Option<f32> {
        match self {
            Self::Auto => None,
            Self::Metres(metres) => Some(metres),
        }
    }
}
