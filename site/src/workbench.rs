//! The workbench as a page without a server: the page of `papsynth workbench`, and the engine in WebAssembly.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result};
use serde_json::Value;

use crate::{Input, gallery, write};

/// Folders of the files of the page.
const PAGE: &str = "crates/papsynth-web/src/workbench/page";
const SHARED: &str = "crates/papsynth-web/src/page";
const ENGINE: &str = "crates/papsynth-wasm/page";

/// Loads only files of the site; the engine may compile.
const POLICY: &str = "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; worker-src 'self'; style-src 'self'; \
     img-src 'self' data: blob:; connect-src 'self'; base-uri 'none'; form-action 'none'";

/// Effort of the compression, 0 to 10.
const EFFORT: u8 = 9;

/// Writes the folder `workbench`.
pub(crate) fn write_page(input: &Input) -> Result<()> {
    let out = input.out.join("workbench");
    let html = input.read(&format!("{PAGE}/index.html"))?;
    for name in files(&html) {
        let folder = if input.root.join(PAGE).join(name).is_file() { PAGE } else { SHARED };
        write(&out.join(name), input.read(&format!("{folder}/{name}"))?)?;
    }
    for name in ["engine.js", "start.css", "worker.js"] {
        write(&out.join(name), input.read(&format!("{ENGINE}/{name}"))?)?;
    }
    let engine = fs::read(&input.engine).with_context(|| format!("cannot read {}", input.engine.display()))?;
    let engine = miniz_oxide::deflate::compress_to_vec_zlib(&engine, EFFORT);
    write(&out.join("engine.wasm.zlib"), &engine)?;
    let start = start(input, &out, engine.len())?;
    let policy = format!("<meta http-equiv=\"Content-Security-Policy\" content=\"{POLICY}\">\n");
    let html = [
        ("<meta name=\"viewport\"", &*policy),
        ("<script src=\"workbench.js\"", "<script src=\"engine.js\" defer></script>\n"),
        ("</head>", "<link rel=\"stylesheet\" href=\"start.css\">\n"),
        ("<button id=\"copy-link\"", "<a href=\"../index.html\">Documentation</a>\n  "),
        ("<canvas id=\"canvas\"", &start),
    ]
    .into_iter()
    .try_fold(html, |html, (before, text)| inserted(&html, before, text))?;
    write(&out.join("index.html"), html)
}

/// Returns the names of the scripts and styles of the page.
fn files(html: &str) -> impl Iterator<Item = &str> {
    let values = |start: &'static str| html.split(start).skip(1).filter_map(|text| text.split('"').next());
    values("<script src=\"").chain(values("<link rel=\"stylesheet\" href=\""))
}

/// Inserts a text before another one, which must occur once.
fn inserted(html: &str, before: &str, text: &str) -> Result<String> {
    let mut parts = html.split(before);
    match (parts.next(), parts.next(), parts.next()) {
        (Some(head), Some(tail), None) => Ok(format!("{head}{text}{before}{tail}")),
        _ => anyhow::bail!("{PAGE}/index.html: expected `{before}` once"),
    }
}

/// Renders the first field, and returns what the page shows before it loads the engine.
fn start(input: &Input, out: &Path, bytes: usize) -> Result<String> {
    let work = input.out.join("workbench-work");
    let folder = work.display().to_string();
    input.papsynth(&["generate", "--preset", "lbc", "--seed", "0", "--frames", "1", "--out", &folder, "--quiet"])?;
    let read = |name: &str| fs::read(work.join(name)).with_context(|| format!("{name} of the first field"));
    let field = read("images/000000.png")?;
    let manifest: Value = serde_json::from_slice(&read("manifest.json")?).context("the manifest of the first field")?;
    fs::remove_dir_all(&work).with_context(|| format!("cannot remove {folder}"))?;
    write(&out.join("field.png"), &field)?;
    let [width, height] = gallery::size(&field).context("the first field is not a PNG image")?;
    Ok(format!(
        "<div id=\"start\">
    <img src=\"field.png\" width=\"{width}\" height=\"{height}\" alt=\"A field of the preset lbc\">
    <div>
      <p>The first field of the preset lbc, rendered by {version}, stream version {stream}.</p>
      <p>The engine renders fields on your machine. Nothing is sent anywhere.</p>
      <button id=\"load\" type=\"button\">Load the engine ({size:.1} MB)</button>
      <p id=\"loading\" role=\"status\"><noscript>The engine needs JavaScript.</noscript></p>
    </div>
  </div>
    ",
        version = input.papsynth(&["--version"])?.trim(),
        stream = manifest["identity"]["stream_version"],
        size = bytes as f64 / 1e6,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scripts_and_styles_are_found() {
        let html =
            "<link rel=\"icon\" href=\"data:,\"><link rel=\"stylesheet\" href=\"a.css\"><script src=\"b.js\" defer>";
        assert_eq!(Vec::from_iter(files(html)), ["b.js", "a.css"]);
    }

    #[test]
    fn texts_are_inserted_once() {
        assert_eq!(inserted("a<b>c", "<b>", "x").unwrap(), "ax<b>c");
        assert!(inserted("a", "<b>", "x").is_err());
        assert!(inserted("<b><b>", "<b>", "x").is_err());
    }
}
