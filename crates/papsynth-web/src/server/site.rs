//! Sites: what replies to requests.

use super::message::{MAX_BODY, Reply, Request};

/// A site that answers requests.
pub trait Site {
    /// Returns the reply to a request. Requests from pages of other sites are rejected before. Calls are sequential.
    fn reply(&mut self, request: &Request) -> Reply;

    /// Returns the maximum length of a request body, bytes.
    fn max_body(&self) -> usize {
        MAX_BODY
    }

    /// Returns the work that computes the reply to a request, or `None` if [`reply`](Self::reply) is fast. The work
    /// runs on its own thread, while the site replies to other requests.
    fn slow_reply(&mut self, _request: &Request) -> Option<SlowReply> {
        None
    }
}

/// Work that computes a reply.
pub type SlowReply = Box<dyn FnOnce() -> Reply + Send>;
