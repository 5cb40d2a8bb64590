//! What is asked and what is answered.

use std::borrow::Cow;

use serde::Serialize;
use serde::de::DeserializeOwned;

/// Longest body of a request, bytes.
pub const LONGEST_BODY: usize = 4096;

/// The type of JSON.
pub const JSON: &str = "application/json";

/// A request, without what does not matter.
#[derive(Debug, Clone, Copy, Default)]
pub struct Request<'a> {
    /// "GET", "POST", …, as it stands in the request line.
    pub method: &'a str,
    /// The target as it stands in the request line: a path, and a query if there is one. Nothing is decoded.
    pub target: &'a str,
    /// The type of the body.
    pub content_type: Option<&'a [u8]>,
    /// The body of a POST, at most [`LONGEST_BODY`] bytes; of all else nothing.
    pub body: &'a [u8],
}

impl Request<'_> {
    /// The body of a request. It has to say that it is JSON, which browsers let no page from elsewhere say unasked.
    ///
    /// # Errors
    /// What to reply if it is of another type, too long, or not what is expected.
    pub fn json<T: DeserializeOwned>(&self) -> Result<T, Reply> {
        if self.content_type != Some(JSON.as_bytes()) {
            return Err(Reply::refusal(415, "application/json is expected"));
        }
        if self.body.len() > LONGEST_BODY {
            return Err(Reply::refusal(413, "that is too long"));
        }
        serde_json::from_slice(self.body).map_err(|error| Reply::refusal(400, &error.to_string()))
    }
}

/// A reply. All carry the same headers but for the type and length of their body.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Reply {
    /// Status code of HTTP.
    pub status: u16,
    /// The type of the body.
    pub content_type: &'static str,
    /// The body.
    pub body: Cow<'static, [u8]>,
    /// What is allowed, where something else was asked.
    pub allow: Option<&'static str>,
}

impl Reply {
    /// A text that is part of the program.
    #[must_use]
    pub fn page(content_type: &'static str, text: &'static str) -> Self {
        Self { status: 200, content_type, body: text.as_bytes().into(), allow: None }
    }

    /// A value as JSON; a refusal if it has none.
    #[must_use]
    pub fn json(value: &impl Serialize) -> Self {
        match serde_json::to_vec(value) {
            Ok(body) => Self { status: 200, content_type: JSON, body: body.into(), allow: None },
            Err(error) => Self::refusal(500, &error.to_string()),
        }
    }

    /// A PNG file.
    #[must_use]
    pub fn png(file: Vec<u8>) -> Self {
        Self { status: 200, content_type: "image/png", body: file.into(), allow: None }
    }

    /// Why there is no other reply: `{"error": message}`.
    #[must_use]
    pub fn refusal(status: u16, message: &str) -> Self {
        let body = serde_json::json!({ "error": message }).to_string().into_bytes();
        Self { status, content_type: JSON, body: body.into(), allow: None }
    }

    /// The refusal of a method where another one is allowed.
    #[must_use]
    pub fn method(allow: &'static str) -> Self {
        Self { allow: Some(allow), ..Self::refusal(405, "this is asked for otherwise") }
    }
}

impl From<papsynth_dataset::Error> for Reply {
    fn from(error: papsynth_dataset::Error) -> Self {
        Self::refusal(500, &error.to_string())
    }
}
