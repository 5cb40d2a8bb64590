//! Figures: pictures that the commands of a page make, with links of the commands into the workbench.
//!
//! A picture `![text](made:out/images/000000.png)` is the file of this path after all commands of the page. The
//! commands run in one new folder, with the blocks of TOML that have a file name.

use std::fs;
use std::path::PathBuf;

use anyhow::{Context, Result, ensure};
use pulldown_cmark::{CodeBlockKind, Event, Tag, TagEnd};

use crate::page::{Page, escape};
use crate::{Input, Pictures, fragment, write};

/// Begins the address of a picture that a command makes.
const MADE: &str = "made:";

/// The figures of one page.
pub(crate) struct Figures<'a> {
    input: &'a Input,
    page: &'a Page,
    /// Folder in which the commands run.
    folder: PathBuf,
}

impl<'a> Figures<'a> {
    /// Runs the commands of a page. Returns `None` if it has no figures.
    pub(crate) fn make(input: &'a Input, page: &'a Page, events: &[Event<'_>]) -> Result<Option<Self>> {
        let is_made = |event: &Event<'_>| matches!(event, Event::Start(Tag::Image { dest_url, .. }) if dest_url.starts_with(MADE));
        if !events.iter().any(is_made) {
            return Ok(None);
        }
        let figures = Self { input, page, folder: input.out.join("figures-work") };
        fs::create_dir_all(&figures.folder).with_context(|| format!("cannot create {}", figures.folder.display()))?;
        for (info, text) in blocks(events) {
            if let Some(name) = info.strip_prefix("toml ") {
                write(&figures.folder.join(name), text)?;
            } else if info == "sh" && input.pictures == Pictures::Rendered {
                figures.run(&text)?;
            }
        }
        Ok(Some(figures))
    }

    /// Runs the commands of `papsynth` in a block; others, such as `cargo`, do not make figures.
    fn run(&self, text: &str) -> Result<()> {
        for words in commands(text)? {
            let mut words: Vec<&str> = words.iter().map(String::as_str).collect();
            if ["generate", "sweep"].contains(&words[0]) {
                words.push("--quiet");
            }
            self.input.papsynth_in(&self.folder, &words)?;
        }
        Ok(())
    }

    /// Returns the events of the page with pictures, and links after commands.
    pub(crate) fn placed<'e>(&self, events: Vec<Event<'e>>) -> Result<Vec<Event<'e>>> {
        let mut placed = Vec::with_capacity(events.len());
        let mut events = events.into_iter();
        let mut shell = None;
        while let Some(event) = events.next() {
            match &event {
                Event::Start(Tag::Image { dest_url, .. }) if dest_url.starts_with(MADE) => {
                    let inside = events.by_ref().take_while(|event| !matches!(event, Event::End(TagEnd::Image)));
                    let text: String = inside.filter_map(|event| text_of(&event).map(str::to_owned)).collect();
                    placed.push(Event::InlineHtml(self.picture(&dest_url[MADE.len()..], &text)?.into()));
                    continue;
                }
                Event::Start(Tag::CodeBlock(CodeBlockKind::Fenced(info))) if &**info == "sh" => {
                    shell = Some(String::new());
                }
                Event::Text(text) => {
                    if let Some(shell) = &mut shell {
                        shell.push_str(text);
                    }
                }
                _ => (),
            }
            let is_end = matches!(event, Event::End(TagEnd::CodeBlock));
            placed.push(event);
            if let Some(text) = shell.take_if(|_| is_end) {
                placed.push(Event::Html(self.links(&text)?.into()));
            }
        }
        Ok(placed)
    }

    /// Copies a picture into the site and returns its element.
    fn picture(&self, path: &str, text: &str) -> Result<String> {
        if self.input.pictures == Pictures::LeftOut {
            return Ok(String::new());
        }
        let made = self.folder.join(path);
        let bytes = fs::read(&made).with_context(|| format!("no command of the page writes {path}"))?;
        let [width, height] = size(&bytes).with_context(|| format!("{} is not a PNG image", made.display()))?;
        let copy = format!("{}/{}", self.page.path.trim_end_matches(".html"), path.replace("/images/000000", ""));
        write(&self.input.out.join(&copy), &bytes)?;
        let address = self.page.address_of(&copy);
        Ok(format!(
            "<a class=\"picture\" href=\"{address}\"><img src=\"{address}\" width=\"{width}\" height=\"{height}\" \
             loading=\"lazy\" alt=\"{}\"></a>",
            escape(text)
        ))
    }

    /// Returns links into the workbench for the commands of a block that write one field.
    fn links(&self, text: &str) -> Result<String> {
        let mut links = String::new();
        for words in commands(text)?.iter().filter(|words| words[0] == "generate") {
            let address = fragment::address(self.input, &self.folder, &words[1..])
                .with_context(|| format!("papsynth {}", words.join(" ")))?;
            let address = escape(&self.page.address_of(&address));
            links += &format!("<p><a href=\"{address}\">Open this field in the workbench</a></p>\n");
        }
        Ok(links)
    }

    /// Removes what the commands have written.
    pub(crate) fn remove(self) -> Result<()> {
        fs::remove_dir_all(&self.folder).with_context(|| format!("cannot remove {}", self.folder.display()))
    }
}

/// Returns the blocks of code of a page: words after the fence, and text.
fn blocks(events: &[Event<'_>]) -> Vec<(String, String)> {
    let mut found: Vec<(String, String)> = Vec::new();
    let mut is_inside = false;
    for event in events {
        match event {
            Event::Start(Tag::CodeBlock(CodeBlockKind::Fenced(info))) => {
                is_inside = true;
                found.push((info.to_string(), String::new()));
            }
            Event::End(TagEnd::CodeBlock) => is_inside = false,
            Event::Text(text) if is_inside => {
                found.iter_mut().last().into_iter().for_each(|(_, all)| all.push_str(text))
            }
            _ => (),
        }
    }
    found
}

/// Returns the words after `papsynth` of each of its commands.
fn commands(text: &str) -> Result<Vec<Vec<String>>> {
    let joined = text.replace("\\\n", " ");
    let mut found = Vec::new();
    for line in joined.lines() {
        let words = shlex::split(line).with_context(|| format!("a quote is open at the end of: {line}"))?;
        if let [program, words @ ..] = &words[..]
            && program == "papsynth"
        {
            ensure!(!words.is_empty(), "a command is missing: {line}");
            found.push(words.to_vec());
        }
    }
    Ok(found)
}

fn text_of<'e>(event: &'e Event<'_>) -> Option<&'e str> {
    match event {
        Event::Text(text) | Event::Code(text) => Some(text),
        _ => None,
    }
}

/// Returns width and height of a PNG image.
pub(crate) fn size(bytes: &[u8]) -> Option<[u32; 2]> {
    let number = |at: usize| Some(u32::from_be_bytes(bytes.get(at..at + 4)?.try_into().ok()?));
    bytes.starts_with(b"\x89PNG").then(|| Some([number(16)?, number(20)?]))?
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_of_the_program_are_found() {
        let found = commands("papsynth generate \\\n    --set 'a=[1, 2]'   # one\ncargo xtask figures\n").unwrap();
        assert_eq!(found, [["generate", "--set", "a=[1, 2]"]]);
        assert!(commands("papsynth generate 'a").is_err());
    }
}
