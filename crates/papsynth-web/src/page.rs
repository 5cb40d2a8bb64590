//! The files of the pages, which are part of the program.

use crate::server::{Reply, Request};

/// A file of a page: the path that it is asked for by, its type, its text.
pub(crate) type File = (&'static str, &'static str, &'static str);

pub(crate) const HTML: &str = "text/html; charset=utf-8";
pub(crate) const CSS: &str = "text/css; charset=utf-8";
pub(crate) const JS: &str = "text/javascript; charset=utf-8";

/// What all pages share.
const SHARED: [File; 2] =
    [("/base.css", CSS, include_str!("page/base.css")), ("/base.js", JS, include_str!("page/base.js"))];

/// The file of a page that is asked for, if it is one.
pub(crate) fn file(own: &[File], request: &Request) -> Option<Reply> {
    let (_, content_type, text) = own.iter().chain(&SHARED).find(|file| file.0 == request.target)?;
    Some(if request.method == "GET" { Reply::page(content_type, text) } else { Reply::method("GET") })
}
