//! An HTTP server on 127.0.0.1.

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

use super::message::{Reply, Request};
use super::origin::OriginCheck;
use super::site::Site;
use crate::error::Error;

/// Interval at which the stop flag is checked.
const POLL: Duration = Duration::from_millis(100);

/// Time limit for receiving a request.
const REQUEST_TIMEOUT: Duration = Duration::from_secs(10);

/// Maximum number of simultaneous connections; a browser opens six.
const MAX_CONNECTIONS: usize = 32;

/// Maximum length of a request head, bytes.
const MAX_HEAD: usize = 16 * 1024;

/// Content security policy: the page loads from its own server only, and no other page may embed it.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; \
     base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// Headers of every reply, in addition to `Cache-Control: no-store`.
const HEADERS: [(&str, &str); 5] = [
    ("content-security-policy", POLICY),
    ("cross-origin-opener-policy", "same-origin"),
    ("cross-origin-resource-policy", "same-origin"),
    ("referrer-policy", "no-referrer"),
    ("x-content-type-options", "nosniff"),
];

/// State that all connections share.
struct Shared<S> {
    origin: OriginCheck,
    site: Mutex<S>,
}

impl<S: Site> Shared<S> {
    /// Returns the site, also after a panic in an earlier request: one request must not stop the server.
    fn site(&self) -> MutexGuard<'_, S> {
        self.site.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A listening socket on 127.0.0.1.
#[derive(Debug)]
pub struct Server {
    listener: TcpListener,
    port: u16,
}

impl Server {
    /// Listens on a port of 127.0.0.1, or on any free port if `port` is 0.
    ///
    /// # Errors
    /// If the port is in use or not permitted, or the system clock is outside the years 1970 to 9999.
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

    /// Listens on the previous port if it is free, so that an open page reconnects, and else on any free port.
    ///
    /// # Errors
    /// If no port is available.
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

    /// Serves a site until `stop` is set. Calls `poll` with the site at least ten times a second, and once more when
    /// `stop` is set.
    ///
    /// # Errors
    /// If the runtime or the socket fails.
    pub fn run<S: Site + Send + 'static>(
        self,
        site: S,
        stop: &AtomicBool,
        poll: impl FnMut(&mut S),
    ) -> Result<(), Error> {
        let failed = |source: io::Error| Error::Listen { port: self.port, source };
        // One thread suffices: there is one page, and its requests are short.
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(failed)?;
        let shared = Arc::new(Shared { origin: OriginCheck::new(self.port), site: Mutex::new(site) });
        let guard = runtime.enter();
        let listener = tokio::net::TcpListener::from_std(self.listener).map_err(failed)?;
        runtime.block_on(accept(&listener, &shared, stop, poll));
        drop(guard);
        // Ignores unfinished replies.
        runtime.shutdown_background();
        Ok(())
    }
}

async fn accept<S: Site + Send + 'static>(
    listener: &tokio::net::TcpListener,
    shared: &Arc<Shared<S>>,
    stop: &AtomicBool,
    mut poll: impl FnMut(&mut S),
) {
    let slots = Arc::new(Semaphore::new(MAX_CONNECTIONS));
    loop {
        let stopping = stop.load(Ordering::SeqCst);
        poll(&mut shared.site());
        if stopping {
            return;
        }
        let stream = match tokio::time::timeout(POLL, listener.accept()).await {
            Ok(Ok((stream, _))) => stream,
            // Too many open files, or an aborted connection: later ones may succeed.
            Ok(Err(_)) => {
                tokio::time::sleep(POLL).await;
                continue;
            }
            Err(_) => continue,
        };
        // hyper panics on a date that HTTP cannot express.
        if !is_http_date(now()) {
            continue;
        }
        // Drops the connection if the limit is reached.
        let Ok(slot) = Arc::clone(&slots).try_acquire_owned() else { continue };
        let shared = Arc::clone(shared);
        tokio::spawn(async move {
            let service = service_fn(move |request| {
                let shared = Arc::clone(&shared);
                async move { Ok::<_, Infallible>(response(answer(&shared, request).await)) }
            });
            let mut connection = http1::Builder::new();
            connection.timer(TokioTimer::new()).header_read_timeout(REQUEST_TIMEOUT).max_buf_size(MAX_HEAD);
            // Errors of a connection end that connection only.
            let _ = connection.serve_connection(TokioIo::new(stream), service).await;
            drop(slot);
        });
    }
}

async fn answer<S: Site>(shared: &Shared<S>, request: hyper::Request<Incoming>) -> Reply {
    let (head, body) = request.into_parts();
    // An absolute URI would name a second host.
    if head.uri.authority().is_some() {
        return Reply::error(400, "expected a path, not an absolute URI");
    }
    // Before the body, so that other sites cannot send long ones.
    if let Some(error) = shared.origin.rejects(&head.headers) {
        return error;
    }
    let max_body = shared.site().max_body();
    if body.size_hint().lower() > max_body as u64 {
        return Reply::error(413, "the request body is too long");
    }
    // Only the body of a POST request is read.
    let body = match head.method {
        Method::POST => match tokio::time::timeout(REQUEST_TIMEOUT, Limited::new(body, max_body).collect()).await {
            Ok(Ok(body)) => body.to_bytes(),
            Ok(Err(_)) => return Reply::error(413, "the request body is too long or incomplete"),
            Err(_) => return Reply::error(408, "the request took too long"),
        },
        _ => Bytes::new(),
    };
    let target = head.uri.path_and_query().map_or("", |target| target.as_str());
    let request = Request {
        method: head.method.as_str(),
        target,
        content_type: head.headers.get(CONTENT_TYPE).map(HeaderValue::as_bytes),
        body: &body,
    };
    let slow = {
        let mut site = shared.site();
        match site.slow_reply(&request) {
            Some(slow) => slow,
            None => return site.reply(&request),
        }
    };
    tokio::task::spawn_blocking(slow).await.unwrap_or_else(|_| Reply::error(500, "the program failed at this request"))
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
