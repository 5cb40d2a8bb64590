//! HTTP on 127.0.0.1, for pages of this machine alone.

mod gate;
mod message;

use std::convert::Infallible;
use std::io;
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use http_body_util::{BodyExt, Full, Limited};
use hyper::body::{Body, Bytes, Incoming};
use hyper::header::{ALLOW, CACHE_CONTROL, CONTENT_TYPE, HeaderValue};
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper::{Method, Response, StatusCode};
use hyper_util::rt::{TokioIo, TokioTimer};
use tokio::sync::Semaphore;

use crate::error::Error;
use gate::Gate;
pub use message::{JSON, LONGEST_BODY, Reply, Request};

/// How often it is looked whether the server is to end.
const LOOK: Duration = Duration::from_millis(100);

/// How long a request may take to arrive.
const PATIENCE: Duration = Duration::from_secs(10);

/// Connections at a time; a browser opens six.
const CONNECTIONS: usize = 32;

/// Longest head of a request, bytes.
const LONGEST_HEAD: usize = 16 * 1024;

/// Content security policy: the page loads from its own server only, and no other page may embed it.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; \
     base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// Headers of every reply, beside that nothing is kept by the browser.
const HEADERS: [(&str, &str); 5] = [
    ("content-security-policy", POLICY),
    ("cross-origin-opener-policy", "same-origin"),
    ("cross-origin-resource-policy", "same-origin"),
    ("referrer-policy", "no-referrer"),
    ("x-content-type-options", "nosniff"),
];

/// What is served.
pub trait Site {
    /// What is answered to a request, which comes from a page of this server or from no page at all. Requests are answered one after the other.
    fn reply(&mut self, request: &Request) -> Reply;
}

/// What is served, and who gets to it.
struct Shared<S> {
    gate: Gate,
    site: Mutex<S>,
}

impl<S: Site> Shared<S> {
    /// A site that panicked in the middle of an answer has to be fit for the next one by itself: one request does not end a server.
    fn site(&self) -> MutexGuard<'_, S> {
        self.site.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A place on 127.0.0.1 that a site is served at.
#[derive(Debug)]
pub struct Server {
    listener: TcpListener,
    port: u16,
}

impl Server {
    /// Listens at a port of 127.0.0.1, or at any free one if it is 0.
    ///
    /// # Errors
    /// If the port is taken or not allowed, or the system clock is outside the years 1970 to 9999.
    pub fn bind(port: u16) -> Result<Self, Error> {
        if !is_http_date(now()) {
            return Err(Error::Clock);
        }
        let bind = || {
            let listener = TcpListener::bind(SocketAddr::from((Ipv4Addr::LOCALHOST, port)))?;
            listener.set_nonblocking(true)?;
            let port = listener.local_addr()?.port();
            Ok(Self { listener, port })
        };
        bind().map_err(|source| Error::Listen { port, source })
    }

    /// Listens at the port of last time, if it is still free, so that an open page goes on; else at any.
    ///
    /// # Errors
    /// If no port can be listened at.
    pub fn bind_near(port: u16) -> Result<Self, Error> {
        Self::bind(port).or_else(|_| Self::bind(0))
    }

    /// The port.
    #[must_use]
    pub fn port(&self) -> u16 {
        self.port
    }

    /// The address of the page.
    #[must_use]
    pub fn address(&self) -> String {
        format!("http://127.0.0.1:{}/", self.port)
    }

    /// Serves a site until `stop` is set. `look` sees the site ten times a second at least, and a last time when `stop` is set.
    ///
    /// # Errors
    /// If the system refuses what serving takes.
    pub fn run<S: Site + Send + 'static>(
        self,
        site: S,
        stop: &AtomicBool,
        look: impl FnMut(&mut S),
    ) -> Result<(), Error> {
        let failed = |source: io::Error| Error::Listen { port: self.port, source };
        // One thread: there is one page, and its requests are short.
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(failed)?;
        let shared = Arc::new(Shared { gate: Gate::new(self.port), site: Mutex::new(site) });
        let _inside = runtime.enter();
        let listener = tokio::net::TcpListener::from_std(self.listener).map_err(failed)?;
        runtime.block_on(accept(&listener, &shared, stop, look));
        Ok(())
    }
}

async fn accept<S: Site + Send + 'static>(
    listener: &tokio::net::TcpListener,
    shared: &Arc<Shared<S>>,
    stop: &AtomicBool,
    mut look: impl FnMut(&mut S),
) {
    let places = Arc::new(Semaphore::new(CONNECTIONS));
    loop {
        let ends = stop.load(Ordering::SeqCst);
        look(&mut shared.site());
        if ends {
            return;
        }
        let stream = match tokio::time::timeout(LOOK, listener.accept()).await {
            Ok(Ok((stream, _))) => stream,
            // Too many open files, or a connection that was gone at once: others may do better later.
            Ok(Err(_)) => {
                tokio::time::sleep(LOOK).await;
                continue;
            }
            Err(_) => continue,
        };
        // hyper panics on a date that HTTP cannot express.
        if !is_http_date(now()) {
            continue;
        }
        // Who comes while all places are taken is sent away.
        let Ok(place) = Arc::clone(&places).try_acquire_owned() else { continue };
        let shared = Arc::clone(shared);
        tokio::spawn(async move {
            let service = service_fn(move |request| {
                let shared = Arc::clone(&shared);
                async move { Ok::<_, Infallible>(response(answer(&shared, request).await)) }
            });
            let mut connection = http1::Builder::new();
            connection.timer(TokioTimer::new()).header_read_timeout(PATIENCE).max_buf_size(LONGEST_HEAD);
            // What goes wrong with a connection is over with it.
            let _ = connection.serve_connection(TokioIo::new(stream), service).await;
            drop(place);
        });
    }
}

async fn answer<S: Site>(shared: &Shared<S>, request: hyper::Request<Incoming>) -> Reply {
    let (head, body) = request.into_parts();
    if body.size_hint().lower() > LONGEST_BODY as u64 {
        return Reply::refusal(413, "that is too long");
    }
    // Of anything but a POST the body is not read; the connection ends if there is one.
    let body = match head.method {
        Method::POST => match tokio::time::timeout(PATIENCE, Limited::new(body, LONGEST_BODY).collect()).await {
            Ok(Ok(body)) => body.to_bytes(),
            Ok(Err(_)) => return Reply::refusal(413, "that is too long, or was cut off"),
            Err(_) => return Reply::refusal(408, "that took too long"),
        },
        _ => Bytes::new(),
    };
    // A whole address would name a host besides the header.
    if head.uri.authority().is_some() {
        return Reply::refusal(400, "a path alone is expected");
    }
    if let Some(refusal) = shared.gate.refuses(&head.headers) {
        return refusal;
    }
    let target = head.uri.path_and_query().map_or("", |target| target.as_str());
    let request = Request {
        method: head.method.as_str(),
        target,
        content_type: head.headers.get(CONTENT_TYPE).map(HeaderValue::as_bytes),
        body: &body,
    };
    shared.site().reply(&request)
}

#[expect(clippy::disallowed_methods, reason = "checks the clock that hyper reads; it reaches no image")]
fn now() -> SystemTime {
    SystemTime::now()
}

/// Whether a time is in the years 1970 to 9999, the range of dates in HTTP.
fn is_http_date(time: SystemTime) -> bool {
    const END_S: u64 = 253_402_300_800;
    time.duration_since(UNIX_EPOCH).is_ok_and(|since| since.as_secs() < END_S)
}

fn response(reply: Reply) -> Response<Full<Bytes>> {
    let body = match reply.body {
        std::borrow::Cow::Borrowed(body) => Bytes::from_static(body),
        std::borrow::Cow::Owned(body) => Bytes::from(body),
    };
    let mut response = Response::new(Full::new(body));
    *response.status_mut() = StatusCode::from_u16(reply.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
    let headers = response.headers_mut();
    headers.insert(CONTENT_TYPE, HeaderValue::from_static(reply.content_type));
    headers.insert(CACHE_CONTROL, HeaderValue::from_static("no-store"));
    for (name, value) in HEADERS {
        headers.insert(name, HeaderValue::from_static(value));
    }
    if let Some(allow) = reply.allow {
        headers.insert(ALLOW, HeaderValue::from_static(allow));
    }
    response
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_outside_1970_to_9999_are_no_http_dates() {
        let after = |seconds| UNIX_EPOCH + Duration::from_secs(seconds);
        assert!(is_http_date(UNIX_EPOCH) && is_http_date(after(253_402_300_799)));
        assert!(!is_http_date(UNIX_EPOCH - Duration::from_nanos(1)) && !is_http_date(after(253_402_300_800)));
    }
}
