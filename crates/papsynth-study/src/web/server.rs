//! HTTP on loopback.

use std::convert::Infallible;
use std::io;
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use http_body_util::{BodyExt, Full, Limited};
use hyper::body::{Body, Bytes, Incoming};
use hyper::header::{ALLOW, CACHE_CONTROL, CONTENT_TYPE, HOST, HeaderValue, ORIGIN};
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper::{Method, Response, StatusCode};
use hyper_util::rt::{TokioIo, TokioTimer};
use tokio::sync::Semaphore;

use super::desk::{Desk, LONGEST_BODY, Reply, Request};
use crate::error::Error;
use crate::session::Session;

/// How often it is looked whether the server is to end.
const LOOK: Duration = Duration::from_millis(100);

/// How long a request may take to arrive.
const PATIENCE: Duration = Duration::from_secs(10);

/// Connections at a time; a browser opens six.
const CONNECTIONS: usize = 32;

/// Longest head of a request, bytes.
const LONGEST_HEAD: usize = 16 * 1024;

/// The page may load and ask nothing but its own server, and nobody may put it in a frame.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; \
     base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// Headers of every reply. Nothing is kept by the browser: a patch is seen once.
const HEADERS: [(&str, &str); 5] = [
    ("content-security-policy", POLICY),
    ("cross-origin-opener-policy", "same-origin"),
    ("cross-origin-resource-policy", "same-origin"),
    ("referrer-policy", "no-referrer"),
    ("x-content-type-options", "nosniff"),
];

/// A place on 127.0.0.1 that a study is served at.
#[derive(Debug)]
pub struct Server {
    listener: TcpListener,
    port: u16,
}

impl Server {
    /// Listens at a port of 127.0.0.1, or at any free one if it is 0.
    ///
    /// # Errors
    /// If the port is taken, or not allowed.
    pub fn bind(port: u16) -> Result<Self, Error> {
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

    /// Serves a study until `stop` is set. `finished` is called once when everything has been answered, at once if it has been
    /// before.
    ///
    /// # Errors
    /// If the system refuses what serving takes, or the port cannot be kept with the study.
    pub fn run(self, mut session: Session, stop: &AtomicBool, finished: impl FnMut(&Session)) -> Result<(), Error> {
        session.set_port(self.port)?;
        let failed = |source: io::Error| Error::Listen { port: self.port, source };
        // One thread: a reply takes less than a frame of the page, and there is one page.
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(failed)?;
        let desk = Arc::new(Mutex::new(Desk::new(session, self.port)));
        let _inside = runtime.enter();
        let listener = tokio::net::TcpListener::from_std(self.listener).map_err(failed)?;
        runtime.block_on(accept(&listener, &desk, stop, finished));
        Ok(())
    }
}

async fn accept(
    listener: &tokio::net::TcpListener,
    desk: &Arc<Mutex<Desk>>,
    stop: &AtomicBool,
    mut finished: impl FnMut(&Session),
) {
    let places = Arc::new(Semaphore::new(CONNECTIONS));
    let mut told = false;
    loop {
        let ends = stop.load(Ordering::SeqCst);
        if !told {
            let desk = locked(desk);
            told = desk.session.is_finished();
            if told {
                finished(&desk.session);
            }
        }
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
        // Who comes while all places are taken is sent away.
        let Ok(place) = Arc::clone(&places).try_acquire_owned() else { continue };
        let desk = Arc::clone(desk);
        tokio::spawn(async move {
            let service = service_fn(move |request| {
                let desk = Arc::clone(&desk);
                async move { Ok::<_, Infallible>(response(answer(&desk, request).await)) }
            });
            let mut connection = http1::Builder::new();
            connection.timer(TokioTimer::new()).header_read_timeout(PATIENCE).max_buf_size(LONGEST_HEAD);
            // What goes wrong with a connection is over with it.
            let _ = connection.serve_connection(TokioIo::new(stream), service).await;
            drop(place);
        });
    }
}

/// Nothing that holds the lock can leave the study half changed, so that a panic elsewhere does not end it.
fn locked(desk: &Mutex<Desk>) -> std::sync::MutexGuard<'_, Desk> {
    desk.lock().unwrap_or_else(PoisonError::into_inner)
}

async fn answer(desk: &Mutex<Desk>, request: hyper::Request<Incoming>) -> Reply {
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
    let hosts: Vec<&[u8]> = head.headers.get_all(HOST).iter().map(HeaderValue::as_bytes).collect();
    let target = head.uri.path_and_query().map_or("", |target| target.as_str());
    let request = Request {
        method: head.method.as_str(),
        target,
        hosts: &hosts,
        origin: head.headers.get(ORIGIN).map(HeaderValue::as_bytes),
        content_type: head.headers.get(CONTENT_TYPE).map(HeaderValue::as_bytes),
        body: &body,
    };
    locked(desk).reply(&request)
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
