//! Checks of the headers `Host` and `Origin`.

use hyper::HeaderMap;
use hyper::header::{HOST, HeaderValue, ORIGIN};

use super::message::Reply;

/// Accepts requests that name this server, and rejects all others.
#[derive(Debug)]
pub(super) struct OriginCheck {
    hosts: Vec<String>,
}

impl OriginCheck {
    pub(super) fn new(port: u16) -> Self {
        /// The port that browsers omit.
        const DEFAULT_PORT: u16 = 80;
        let names = ["127.0.0.1", "localhost"];
        let mut hosts: Vec<String> = names.iter().map(|name| format!("{name}:{port}")).collect();
        if port == DEFAULT_PORT {
            hosts.extend(names.map(str::to_owned));
        }
        Self { hosts }
    }

    /// Returns the error reply for a request from another site, or nothing.
    pub(super) fn rejects(&self, headers: &HeaderMap) -> Option<Reply> {
        // DNS rebinding: a page of another site whose name resolves to this machine sends that name as its host.
        let mut hosts = headers.get_all(HOST).iter().map(HeaderValue::as_bytes);
        let (Some(host), None) = (hosts.next(), hosts.next()) else {
            return Some(Reply::error(400, "expected one Host header"));
        };
        if !self.is_own(host) {
            return Some(Reply::error(421, "expected the host 127.0.0.1 or localhost"));
        }
        // Browsers send the origin of a page of another site.
        let own = |origin: &[u8]| self.is_own(origin.strip_prefix(b"http://").unwrap_or_default());
        let origin = headers.get(ORIGIN).map(HeaderValue::as_bytes);
        origin
            .is_some_and(|origin| !own(origin))
            .then(|| Reply::error(403, "requests from pages of other sites are rejected"))
    }

    fn is_own(&self, host: &[u8]) -> bool {
        self.hosts.iter().any(|own| own.as_bytes() == host)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OWN: &str = "127.0.0.1:8123";

    #[test]
    fn foreign_hosts_and_origins_are_rejected() {
        let check = OriginCheck::new(8123);
        let headers = |hosts: &[&'static str], origin: Option<&'static str>| {
            let hosts = hosts.iter().map(|host| (HOST, HeaderValue::from_static(host)));
            let origin = origin.map(|origin| (ORIGIN, HeaderValue::from_static(origin)));
            let mut map = HeaderMap::new();
            map.extend(hosts.chain(origin));
            map
        };
        let ask =
            |hosts: &[&'static str], origin| check.rejects(&headers(hosts, origin)).map_or(200, |reply| reply.status);
        assert_eq!(ask(&["localhost:8123"], None), 200);
        assert_eq!(ask(&[OWN], Some("http://127.0.0.1:8123")), 200);
        for host in [
            "evil.example:8123",
            "127.0.0.1",
            "127.0.0.1:8124",
            "localhost",
            "",
            "127.0.0.1:8123.evil.example",
            "[::1]:8123",
        ] {
            assert_eq!(ask(&[host], None), 421, "{host}");
        }
        assert_eq!(ask(&[], None), 400);
        assert_eq!(ask(&[OWN, OWN], None), 400);
        for origin in
            ["http://evil.example", "null", "https://127.0.0.1:8123", "http://127.0.0.1:81", "", "http://localhost"]
        {
            assert_eq!(ask(&[OWN], Some(origin)), 403, "{origin}");
        }
        assert_eq!(OriginCheck::new(80).rejects(&headers(&["localhost"], None)), None);
    }
}
