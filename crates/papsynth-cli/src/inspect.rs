//! `papsynth inspect`: the contents of a data set.

use std::ops::Range;

use papsynth_dataset::{Identity, Overview, inspect};

use crate::args::{Inspect, check_of};
use crate::exit::{self, ExitError};
use crate::words::{counted, size};

pub(crate) fn run(args: &Inspect) -> Result<(), ExitError> {
    let check = check_of(args.verify);
    let overview = inspect(&args.dir, check)?;
    if args.json {
        let text = serde_json::to_string_pretty(&overview).unwrap_or_default();
        exit::print(&format!("{text}\n"))?;
    } else {
        exit::print(&table(&args.dir.display().to_string(), &overview))?;
    }
    let (shards, files) = (overview.damaged_shards.len() as u64, overview.damaged_files.len() as u64);
    let damaged: Vec<String> = [(shards, "shard", "shards"), (files, "file", "files")]
        .into_iter()
        .filter(|(count, ..)| *count > 0)
        .map(|(count, one, many)| counted(count, one, many))
        .collect();
    if damaged.is_empty() {
        return Ok(());
    }
    let message = format!("{}: damaged: {}", args.dir.display(), damaged.join(", "));
    let help = "`papsynth verify` lists all findings and the commands that repair them";
    Err(ExitError::with_help(message, help))
}

/// Entries of a list that are printed at most.
const MAX_LISTED: usize = 10;

fn table(dir: &str, overview: &Overview) -> String {
    let identity = &overview.manifest.identity;
    let mut out = String::new();
    let mut row = |name: &str, value: &str| out.push_str(&format!("{name:<12}{value}\n"));
    row("data set", dir);
    row("written by", &overview.manifest.writer);
    row("seed", &identity.seed.to_string());
    let Identity { recipe_version, model_version, stream_version, .. } = identity;
    row("versions", &format!("recipe {recipe_version}, model {model_version}, stream {stream_version}"));
    row("frames", &overview.frames.to_string());
    if !overview.missing.is_empty() {
        row("missing", &listed(overview.missing.iter().map(shown)));
    }
    if overview.manifest.frames != overview.frames {
        let merged = counted(overview.manifest.frames, "frame", "frames");
        row("merged", &format!("{merged}; `papsynth merge` adds the rest to objects.csv and coco.json"));
    }
    for finding in overview.damaged_shards.iter().take(MAX_LISTED).chain(&overview.damaged_files) {
        row("damaged", &finding.to_string());
    }
    if overview.frames > 0 {
        let sizes = listed(overview.sizes.iter().map(|[width, height]| format!("{width} x {height} px")));
        let bits = listed(overview.bits.iter().map(|bits| format!("{bits} bits")));
        let planes = listed(overview.planes.iter().map(|n| counted(*n as u64, "plane", "planes")));
        let [least, most] = overview.pixel_um;
        let pixel = if least == most { format!("{least}") } else { format!("{least} to {most}") };
        row("images", &format!("{sizes}; {pixel} um per pixel; {bits}; {planes}"));
        row("on disk", &size(overview.bytes as f64));
        row("", "");
        row("objects", &format!("{:<28}{:>10}{:>12}", "", "total", "per frame"));
        for (category, count) in &overview.objects {
            row("", &format!("{category:<28}{count:>10}{:>12.1}", *count as f64 / overview.frames as f64));
        }
        row("", &format!("{:<28}{:>10}", "partly outside the image", overview.truncated));
    }
    out
}

fn shown(range: &Range<u64>) -> String {
    if range.end - range.start == 1 { range.start.to_string() } else { format!("{}..{}", range.start, range.end) }
}

/// The first entries of a list.
fn listed(items: impl ExactSizeIterator<Item = String>) -> String {
    let more = items.len().saturating_sub(MAX_LISTED);
    let mut text = items.take(MAX_LISTED).collect::<Vec<_>>().join(", ");
    if more > 0 {
        text.push_str(&format!(" and {more} more"));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_lists_are_shortened() {
        assert_eq!(shown(&(3..4)), "3");
        assert_eq!(shown(&(3..9)), "3..9");
        assert!(listed((0..12).map(|n: u64| n.to_string()).collect::<Vec<_>>().into_iter()).ends_with("9 and 2 more"));
    }
}
