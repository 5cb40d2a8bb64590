//! The static files of the pages, compiled into the program.

use crate::server::{Reply, Request};

/// A static file: path, content type, content.
pub(crate) type File = (&'static str, &'static str, &'static str);

pub(crate) const HTML: &str = "text/html; charset=utf-8";
pub(crate) const CSS: &str = "text/css; charset=utf-8";
pub(crate) const JS: &str = "text/javascript; charset=utf-8";

/// Files that all pages use.
const SHARED: [File; 5] = [
    ("/base.css", CSS, include_str!("page/base.css")),
    ("/base.js", JS, include_str!("page/base.js")),
    ("/canvas.css", CSS, include_str!("page/canvas.css")),
    ("/canvas.js", JS, include_str!("page/canvas.js")),
    ("/objects.js", JS, include_str!("page/objects.js")),
];

/// Returns the static file that a request names, if any.
pub(crate) fn file(own: &[File], request: &Request) -> Option<Reply> {
    let (_, content_type, text) = own.iter().chain(&SHARED).find(|file| file.0 == request.target)?;
    Some(if request.method == "GET" { Reply::page(content_type, text) } else { Reply::wrong_method("GET") })
}
