//! The gallery of presets.

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use crate::Input;
use crate::page::{Group, Page};

/// The place of the presets in the page.
const PRESETS: &str = "<!-- presets -->";

/// Returns the page. Its commands make its pictures.
pub(crate) fn page(input: &Input) -> Result<Page> {
    let source = "site/pages/gallery/presets.md";
    let around = input.read(source)?;
    let (before, after) = around.split_once(PRESETS).with_context(|| format!("{source}: expected {PRESETS}"))?;
    let (mut list, mut text) = (String::new(), String::new());
    for line in input.papsynth(&["init", "--list"])?.lines() {
        let (name, meaning) = line.split_once(' ').with_context(|| format!("`papsynth init --list`: {line}"))?;
        let preset = input.read(&format!("crates/papsynth/presets/{name}.toml"))?;
        let meaning = capitalised(meaning.trim());
        list += &format!("- [{name}](#{name}): {meaning}\n");
        text += &format!("\n## {name}\n\n{meaning}.\n\n");
        text += &format!("![A field of the preset {name}](made:{name}/images/000000.png)\n\n");
        text += &format!("```sh\npapsynth generate --preset {name} --frames 1 --seed 7 --out {name}\n```\n\n");
        text +=
            &format!("<details><summary>Recipe: what differs from the default</summary>\n\n```toml\n{preset}```\n\n");
        text += "</details>\n";
    }
    let text = format!("{before}{list}{text}{after}");
    let mut page = Page::new("gallery/presets.html", Group::Gallery, "Presets", text);
    page.source = source.to_owned();
    Ok(page)
}

/// Checks that the gallery of debris has a command for each kind of the schema.
pub(crate) fn check(input: &Input) -> Result<()> {
    let schema: Value = serde_json::from_str(&input.papsynth(&["schema"])?).context("the output of papsynth schema")?;
    let kinds = schema.pointer("/$defs/Debris/properties").and_then(Value::as_object);
    let source = "site/pages/gallery/debris.md";
    let text = input.read(source)?;
    for kind in kinds.context("the schema has no kinds of debris")?.keys() {
        ensure!(text.contains(&format!("--set debris.{kind}.")), "{source}: no command shows `debris.{kind}`");
    }
    Ok(())
}

/// Returns a text whose first letter is a capital.
fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}
