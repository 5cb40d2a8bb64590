//! Requests and replies.

use std::borrow::Cow;

use serde::Serialize;
use serde::de::DeserializeOwned;

/// Maximum length of a request body, bytes, unless the [`Site`](super::Site) accepts longer ones.
pub const MAX_BODY: usize = 4096;

/// Content type of JSON.
pub const JSON: &str = "application/json";

/// The parts of a request that a site needs.
#[derive(Debug, Clone, Copy, Default)]
pub struct Request<'a> {
    /// HTTP method: "GET", "POST", ….
    pub method: &'a str,
    /// Path and query, not decoded.
    pub target: &'a str,
    /// Content type of the body.
    pub content_type: Option<&'a [u8]>,
    /// Body of a POST request; empty for other methods.
    pub body: &'a [u8],
}

impl Request<'_> {
    /// Parses the body as JSON. The content type must be JSON: browsers do not let pages of other sites send it without
    /// asking.
    ///
    /// # Errors
    /// The reply for a body of another type, a body that is too long, or invalid JSON.
    pub fn json<T: DeserializeOwned>(&self) -> Result<T, Reply> {
        self.json_within(MAX_BODY)
    }

    /// As [`json`](Self::json), with another maximum length of the body, bytes.
    pub(crate) fn json_within<T: DeserializeOwned>(&self, max_body: usize) -> Result<T, Reply> {
        if self.content_type != Some(JSON.as_bytes()) {
            return Err(Reply::error(415, "expected content type application/json"));
        }
        if self.body.len() > max_body {
            return Err(Reply::error(413, "the request body is too long"));
        }
        serde_json::from_slice(self.body).map_err(|error| Reply::error(400, &error.to_string()))
    }
}

/// A reply. All replies have the same headers except for the type and length of the body.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Reply {
    /// HTTP status code.
    pub status: u16,
    /// Content type of the body.
    pub content_type: &'static str,
    /// The body.
    pub body: Cow<'static, [u8]>,
    /// Allowed method, if the request used another one.
    pub allow: Option<&'static str>,
}

impl Reply {
    /// Returns a file that is compiled into the program.
    #[must_use]
    pub fn page(content_type: &'static str, text: &'static str) -> Self {
        Self { status: 200, content_type, body: text.as_bytes().into(), allow: None }
    }

    /// Returns a value as JSON, or status 500 if it cannot be serialised.
    #[must_use]
    pub fn json(value: &impl Serialize) -> Self {
        match serde_json::to_vec(value) {
            Ok(body) => Self { status: 200, content_type: JSON, body: body.into(), allow: None },
            Err(error) => Self::error(500, &error.to_string()),
        }
    }

    /// Returns a PNG file.
    #[must_use]
    pub fn png(file: Vec<u8>) -> Self {
        Self { status: 200, content_type: "image/png", body: file.into(), allow: None }
    }

    /// Returns binary data.
    #[must_use]
    pub fn binary(body: Vec<u8>) -> Self {
        Self { status: 200, content_type: "application/octet-stream", body: body.into(), allow: None }
    }

    /// Returns an error as JSON: `{"error": message}`.
    #[must_use]
    pub fn error(status: u16, message: &str) -> Self {
        let body = serde_json::json!({ "error": message }).to_string().into_bytes();
        Self { status, content_type: JSON, body: body.into(), allow: None }
    }

    /// Returns status 405 with the allowed method.
    #[must_use]
    pub fn wrong_method(allow: &'static str) -> Self {
        Self { allow: Some(allow), ..Self::error(405, &format!("expected method {allow}")) }
    }
}

impl From<papsynth_dataset::Error> for Reply {
    fn from(error: papsynth_dataset::Error) -> Self {
        Self::error(500, &error.to_string())
    }
}
