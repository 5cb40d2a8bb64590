//! Equations in LaTeX to MathML, which browsers typeset without scripts.

use anyhow::{Context, Result, bail};
use pulldown_cmark::Event;
use pulldown_latex::config::{DisplayMode, RenderConfig};
use pulldown_latex::mathml::push_mathml;
use pulldown_latex::{Parser, Storage};

/// Replaces the equations of a page by MathML.
pub(crate) fn typeset(events: &mut [Event<'_>]) -> Result<()> {
    for event in events {
        *event = match event {
            Event::InlineMath(latex) => Event::InlineHtml(mathml(latex, DisplayMode::Inline)?.into()),
            Event::DisplayMath(latex) => {
                let equation = mathml(latex, DisplayMode::Block)?;
                Event::InlineHtml(format!("<span class=\"wide equation\">{equation}</span>").into())
            }
            _ => continue,
        };
    }
    Ok(())
}

fn mathml(latex: &str, display_mode: DisplayMode) -> Result<String> {
    let storage = Storage::new();
    // The writer would put the message of an error into the page.
    if let Some(Err(error)) = Parser::new(latex, &storage).find(Result::is_err) {
        bail!("the equation {latex}: {error}");
    }
    let mut text = String::new();
    let config = RenderConfig { display_mode, ..RenderConfig::default() };
    push_mathml(&mut text, Parser::new(latex, &storage), config).with_context(|| format!("the equation {latex}"))?;
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equations_become_mathml_or_an_error() {
        let mut events = [Event::InlineMath("10^{-A}".into()), Event::DisplayMath("\\frac{1}{2}".into())];
        typeset(&mut events).unwrap();
        let [Event::InlineHtml(inline), Event::InlineHtml(block)] = &events else { panic!("{events:?}") };
        assert!(inline.starts_with("<math") && inline.contains("<msup>"), "{inline}");
        assert!(block.contains("display=\"block\"") && block.contains("<mfrac>"), "{block}");
        assert!(typeset(&mut [Event::InlineMath("\\unknown".into())]).is_err());
    }
}
