//! Who gets an answer.

use hyper::HeaderMap;
use hyper::header::{HOST, HeaderValue, ORIGIN};

use super::message::Reply;

/// What a browser of this machine calls this server.
#[derive(Debug)]
pub(super) struct Gate {
    hosts: Vec<String>,
}

impl Gate {
    pub(super) fn new(port: u16) -> Self {
        /// The port that browsers leave out.
        const UNSAID: u16 = 80;
        let names = ["127.0.0.1", "localhost"];
        let mut hosts: Vec<String> = names.iter().map(|name| format!("{name}:{port}")).collect();
        if port == UNSAID {
            hosts.extend(names.map(str::to_owned));
        }
        Self { hosts }
    }

    /// What to say to who gets no answer.
    pub(super) fn refuses(&self, headers: &HeaderMap) -> Option<Reply> {
        // A page from elsewhere whose name was made to lead here calls this server by that name (DNS rebinding).
        let mut hosts = headers.get_all(HOST).iter().map(HeaderValue::as_bytes);
        let (Some(host), None) = (hosts.next(), hosts.next()) else {
            return Some(Reply::refusal(400, "one Host is expected"));
        };
        if !self.is_own(host) {
            return Some(Reply::refusal(421, "this server answers to 127.0.0.1 and localhost alone"));
        }
        // A page from elsewhere that calls this server by its own name says where it comes from.
        let own = |origin: &[u8]| self.is_own(origin.strip_prefix(b"http://").unwrap_or_default());
        let origin = headers.get(ORIGIN).map(HeaderValue::as_bytes);
        origin.is_some_and(|origin| !own(origin)).then(|| Reply::refusal(403, "pages from elsewhere get no answer"))
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
    fn hosts_and_origins_from_elsewhere_get_nothing() {
        let gate = Gate::new(8123);
        let headers = |hosts: &[&'static str], origin: Option<&'static str>| {
            let hosts = hosts.iter().map(|host| (HOST, HeaderValue::from_static(host)));
            let origin = origin.map(|origin| (ORIGIN, HeaderValue::from_static(origin)));
            let mut map = HeaderMap::new();
            map.extend(hosts.chain(origin));
            map
        };
        let ask =
            |hosts: &[&'static str], origin| gate.refuses(&headers(hosts, origin)).map_or(200, |reply| reply.status);
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
        assert_eq!(Gate::new(80).refuses(&headers(&["localhost"], None)), None);
    }
}
