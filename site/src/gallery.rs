//! The gallery of presets. The commands on the page make its pictures.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};

use crate::page::{Group, Page};
use crate::{Input, Pictures};

/// The place of the presets in the page.
const PRESETS: &str = "<!-- presets -->";

/// Returns the page, after its pictures are rendered.
pub(crate) fn page(input: &Input) -> Result<Page> {
    let around = input.read("site/pages/gallery.md")?;
    let (before, after) = around.split_once(PRESETS).with_context(|| format!("gallery.md: expected {PRESETS}"))?;
    let (mut list, mut text) = (String::new(), String::new());
    let work = input.out.join("gallery-work");
    for line in input.papsynth(&["init", "--list"])?.lines() {
        let (name, meaning) = line.split_once(' ').with_context(|| format!("`papsynth init --list`: {line}"))?;
        let preset = input.read(&format!("crates/papsynth/presets/{name}.toml"))?;
        let words = ["generate", "--preset", name, "--frames", "1", "--seed", "7", "--out", name];
        let meaning = capitalised(meaning.trim());
        list += &format!("- [{name}](#{name}): {meaning}\n");
        text += &format!("\n## {name}\n\n{meaning}.\n\n");
        if input.pictures == Pictures::Rendered {
            text += &picture(input, &work, name, &words)?;
        }
        text += &format!("```sh\npapsynth {}\n```\n\n", words.join(" "));
        text +=
            &format!("<details><summary>Recipe: what differs from the default</summary>\n\n```toml\n{preset}```\n\n");
        text += "</details>\n";
    }
    if work.exists() {
        fs::remove_dir_all(&work).with_context(|| format!("cannot remove {}", work.display()))?;
    }
    let mut page =
        Page::new("gallery.html", Group::Start, "Gallery of presets", format!("{before}{list}{text}{after}"));
    page.source = "site/pages/gallery.md".to_owned();
    Ok(page)
}

/// Returns a text whose first letter is a capital.
fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// Renders a field and returns its element.
fn picture(input: &Input, work: &Path, name: &str, words: &[&str]) -> Result<String> {
    let folder = work.join(name).display().to_string();
    let mut words = words.to_vec();
    if let Some(out) = words.last_mut() {
        *out = &folder;
    }
    words.push("--quiet");
    input.papsynth(&words)?;
    let made = work.join(name).join("images/000000.png");
    let bytes = fs::read(&made).with_context(|| format!("cannot read {}", made.display()))?;
    let [width, height] = size(&bytes).with_context(|| format!("{} is not a PNG image", made.display()))?;
    let copy = format!("gallery/{name}.png");
    crate::write(&input.out.join(&copy), &bytes)?;
    ensure!(width > 0 && height > 0, "{} is empty", made.display());
    Ok(format!(
        "<a class=\"picture\" href=\"{copy}\"><img src=\"{copy}\" width=\"{width}\" height=\"{height}\" \
         loading=\"lazy\" alt=\"A field of the preset {name}\"></a>\n\n"
    ))
}

/// Returns width and height of a PNG image.
pub(crate) fn size(bytes: &[u8]) -> Option<[u32; 2]> {
    let number = |at: usize| Some(u32::from_be_bytes(bytes.get(at..at + 4)?.try_into().ok()?));
    bytes.starts_with(b"\x89PNG").then(|| Some([number(16)?, number(20)?]))?
}
