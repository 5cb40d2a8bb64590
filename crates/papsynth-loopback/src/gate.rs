//! Who gets an answer.

use crate::message::{Reply, Request};

/// What a browser of this machine calls this server.
#[derive(Debug)]
pub(crate) struct Gate {
    hosts: Vec<String>,
}

impl Gate {
    pub(crate) fn new(port: u16) -> Self {
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
    pub(crate) fn refuses(&self, request: &Request) -> Option<Reply> {
        // A page from elsewhere whose name was made to lead here calls this server by that name (DNS rebinding).
        let [host] = request.hosts else { return Some(Reply::refusal(400, "one Host is expected")) };
        if !self.is_own(host) {
            return Some(Reply::refusal(421, "this server answers to 127.0.0.1 and localhost alone"));
        }
        // A page from elsewhere that calls this server by its own name says where it comes from.
        let own = |origin: &[u8]| self.is_own(origin.strip_prefix(b"http://").unwrap_or_default());
        request
            .origin
            .is_some_and(|origin| !own(origin))
            .then(|| Reply::refusal(403, "pages from elsewhere get no answer"))
    }

    fn is_own(&self, host: &[u8]) -> bool {
        self.hosts.iter().any(|own| own.as_bytes() == host)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOST: &[&[u8]] = &[b"127.0.0.1:8123"];

    #[test]
    fn hosts_and_origins_from_elsewhere_get_nothing() {
        let gate = Gate::new(8123);
        let ask = |hosts: &[&[u8]], origin: Option<&[u8]>| {
            let request = Request { method: "GET", target: "/state", hosts, origin, ..Request::default() };
            gate.refuses(&request).map_or(200, |reply| reply.status)
        };
        assert_eq!(ask(&[b"localhost:8123"], None), 200);
        assert_eq!(ask(HOST, Some(b"http://127.0.0.1:8123")), 200);
        for host in [
            "evil.example:8123",
            "127.0.0.1",
            "127.0.0.1:8124",
            "localhost",
            "",
            "127.0.0.1:8123.evil.example",
            "[::1]:8123",
        ] {
            assert_eq!(ask(&[host.as_bytes()], None), 421, "{host}");
        }
        assert_eq!(ask(&[], None), 400);
        assert_eq!(ask(&[HOST[0], HOST[0]], None), 400);
        for origin in
            ["http://evil.example", "null", "https://127.0.0.1:8123", "http://127.0.0.1:81", "", "http://localhost"]
        {
            assert_eq!(ask(HOST, Some(origin.as_bytes())), 403, "{origin}");
        }
        let ask = Request { method: "GET", target: "/state", hosts: &[b"localhost"], ..Request::default() };
        assert_eq!(Gate::new(80).refuses(&ask), None);
    }
}
