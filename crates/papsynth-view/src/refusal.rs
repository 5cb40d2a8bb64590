//! Why something that was asked for is not answered.

use papsynth_loopback::Reply;

/// A status of HTTP, and what is said with it.
#[derive(Debug)]
pub(crate) struct Refusal {
    pub(crate) status: u16,
    pub(crate) message: String,
}

impl Refusal {
    /// There is no such thing.
    pub(crate) fn nothing(what: impl Into<String>) -> Self {
        Self { status: 404, message: what.into() }
    }

    /// It was asked for in a way that means nothing.
    pub(crate) fn nonsense(what: impl Into<String>) -> Self {
        Self { status: 400, message: what.into() }
    }

    /// It is there and cannot be shown.
    pub(crate) fn damaged(what: impl Into<String>) -> Self {
        Self { status: 500, message: what.into() }
    }
}

impl From<papsynth_dataset::Error> for Refusal {
    fn from(error: papsynth_dataset::Error) -> Self {
        Self::damaged(error.to_string())
    }
}

impl From<Refusal> for Reply {
    fn from(refusal: Refusal) -> Self {
        Self::refusal(refusal.status, &refusal.message)
    }
}
