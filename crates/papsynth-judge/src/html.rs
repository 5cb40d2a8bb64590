//! The report as a page that needs nothing else.

use std::fmt::Write;

use base64::Engine;
use base64::prelude::BASE64_STANDARD;

use crate::crops::Sheet;
use crate::judge::{Beside, Curve, Report, Spread, Test, Verdict};
use crate::moments::Moments;
use crate::number::nearest;
use crate::svg::{COLOURS, Plot, escape, short};
use crate::two_sample::TwoSample;

/// Giveaways that are listed.
const LISTED: usize = 30;

const STYLE: &str = "body{font:15px/1.45 system-ui,sans-serif;margin:2em auto;max-width:1240px;padding:0 1em;color:#222}\
h1{font-size:1.5em}h2{margin-top:2em;border-bottom:1px solid #ccc}table{border-collapse:collapse;font-size:13px}\
td,th{padding:2px 9px;text-align:right;border-bottom:1px solid #eee}td:first-child,th:first-child{text-align:left}\
svg text{font:11px system-ui,sans-serif;fill:#333}svg .title{font-weight:600;font-size:12px}\
.told{color:#b03000;font-weight:600}.not{color:#00704a;font-weight:600}.out{color:#b03000}\
.real{color:#0072b2}.synthetic{color:#d55e00}.plots{display:flex;flex-wrap:wrap;gap:14px}\
.crops{display:flex;flex-wrap:wrap;gap:5px}.crops figure{margin:0;font-size:10px;text-align:center;color:#666}\
.nuclei img{width:80px;image-rendering:pixelated}.patches img{width:150px}.note{color:#555}";

/// Adds text to a page. Writing to a string cannot fail.
macro_rules! put {
    ($page:expr, $($text:tt)*) => {{
        let _ = write!($page, $($text)*);
    }};
}

impl Report {
    /// The report as an HTML page that loads nothing from elsewhere. It shows pieces of the pictures that were judged.
    #[must_use]
    pub fn to_html(&self) -> String {
        let mut page = String::new();
        let [real, synthetic] = self.fields.each_ref().map(Vec::len);
        let nuclei = match self.gauge.nuclei_from {
            crate::NucleiFrom::Masks => "from masks",
            crate::NucleiFrom::Points => "around given points",
            crate::NucleiFrom::Search => "found",
        };
        put!(
            page,
            "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><title>papsynth judge</title><style>{STYLE}</style></head><body>\
             <h1>{real} real fields against {synthetic} synthetic ones: {}</h1>",
            verdict(self.verdict)
        );
        put!(
            page,
            "<p>Pixels of {} µm; nuclei {nuclei}; seed {}. <span class=\"real\">Real</span> and <span class=\"synthetic\">synthetic</span> \
             have these colours throughout.</p>",
            self.gauge.pixel_um,
            self.judge.seed
        );
        for note in &self.notes {
            put!(page, "<p class=\"note\">{}</p>", escape(note));
        }
        summary(&mut page, self);
        for test in &self.two_sample {
            two_sample(&mut page, test, &self.crops);
        }
        for test in &self.moments {
            moments(&mut page, test);
        }
        beside(&mut page, &self.beside);
        page.push_str("</body></html>\n");
        page
    }
}

fn verdict(verdict: Verdict) -> String {
    let class = if verdict == Verdict::ToldApart { "told" } else { "not" };
    format!("<span class=\"{class}\">{verdict}</span>")
}

/// A row of a table; red if it is not within what is expected.
fn row(page: &mut String, within: bool, cells: impl IntoIterator<Item = String>) {
    page.push_str(if within { "<tr>" } else { "<tr class=\"out\">" });
    cells.into_iter().for_each(|cell| put!(page, "<td>{cell}</td>"));
    page.push_str("</tr>");
}

fn summary(page: &mut String, report: &Report) {
    page.push_str("<h2>Tests</h2><table><tr><th>test</th><th>rows</th><th>AUC</th><th>95 % interval</th><th>between real halves</th><th>verdict</th></tr>");
    for test in &report.two_sample {
        let TwoSample { rows: [real, synthetic], auc, interval: [low, high], null, null_rows, .. } = &test.result;
        let null = Spread::of(null.iter().copied());
        let [p10, p50, p90] = [null.p10, null.p50, null.p90].map(known);
        let cells = [
            format!("classifier on {}", escape(&test.name)),
            format!("{real} / {synthetic}"),
            format!("{auc:.3}"),
            format!("{low:.3} – {high:.3}"),
            format!("{p50} ({p10} – {p90}), {null_rows} rows a half"),
            verdict(test.verdict),
        ];
        row(page, true, cells);
    }
    for test in &report.moments {
        let Moments { n, descriptors } = &test.result;
        let outside = descriptors.iter().filter(|d| !d.within).count();
        let slopes: Vec<String> = descriptors.iter().map(|d| format!("{:.2}", d.slope[1])).collect();
        let name = format!("Q-Q slopes, {}", escape(&test.name));
        let outside = format!("{outside} of {} outside", descriptors.len());
        row(page, true, [name, n.to_string(), String::new(), slopes.join(" "), outside, verdict(test.verdict)]);
    }
    page.push_str(
        "</table><p class=\"note\">A classifier tells the sides apart if its area under the ROC curve is larger than 95 of 100 between random \
         halves of the real fields, and the 95 % interval of it (fields drawn with replacement) leaves out ½. Fields are never split between what it learns from and \
         what it is tried on. Moments tell them apart if a slope or a shift of medians lies outside what 199 of 200 pairs of disjoint \
         real halves show at the same number of nuclei: by chance, one of the twelve does in one comparison of seventeen or fewer.</p>",
    );
}

fn known(value: Option<f64>) -> String {
    value.map_or_else(|| "–".to_owned(), short)
}

fn two_sample(page: &mut String, test: &Test<TwoSample>, crops: &[Sheet]) {
    let r = &test.result;
    let (name, auc, verdict) = (escape(&test.name), r.auc, verdict(test.verdict));
    put!(page, "<h2>What gives {name} away</h2><p>AUC {auc:.3}, {verdict}. With features of one kind alone: ");
    let kinds: Vec<String> =
        r.families.iter().map(|f| format!("{} {:.2}", format!("{:?}", f.family).to_lowercase(), f.auc)).collect();
    put!(page, "{}.</p><div class=\"plots\">{}{}</div>", kinds.join(", "), strip(r), scores(r));
    page.push_str(
        "<table><tr><th>feature</th><th>importance</th><th>AUC alone</th><th class=\"real\">real p10</th><th class=\"real\">p50</th><th class=\"real\">p90</th>\
         <th class=\"synthetic\">synthetic p10</th><th class=\"synthetic\">p50</th><th class=\"synthetic\">p90</th>\
         <th class=\"real\">sd between fields</th><th class=\"synthetic\">sd between fields</th></tr>",
    );
    for g in r.giveaways.iter().take(LISTED) {
        let first = [escape(&g.feature), format!("{:.3}", g.importance), format!("{:.2}", g.alone)];
        let numbers = g.real.iter().chain(&g.synthetic).chain(&g.between_fields);
        row(page, true, first.into_iter().chain(numbers.map(|v| short(*v))));
    }
    page.push_str(
        "</table><p class=\"note\">Importance: how much nearer the mean scores of both sides come, as a part of their distance, when the feature is \
         shuffled among rows that the classifier has not seen. Of features that tell the same, each alone matters little. AUC alone is above ½ if the feature is larger in synthetic fields. Between fields: of their medians.</p>",
    );
    for sheet in crops.iter().filter(|sheet| sheet.of == test.name && !sheet.crops.is_empty()) {
        put!(page, "<h3>{}</h3><div class=\"crops {}\">", sheet.title, sheet.of);
        for crop in &sheet.crops {
            let (png, field) = (BASE64_STANDARD.encode(png(&crop.grey, crop.width)), escape(&crop.field));
            let score = crop.score;
            put!(page, "<figure><img alt=\"\" src=\"data:image/png;base64,{png}\"><br>{score:.2} {field}</figure>");
        }
        page.push_str("</div>");
    }
}

fn strip(r: &TwoSample) -> String {
    let all = r.null.iter().copied().chain(r.interval).chain([0.3, 1.0]);
    let names = ["AUC with its 95 % interval", "AUC", "1 real halves, 2 the sides"];
    let mut plot = Plot::new(names, all, [0.0, 3.0].into_iter());
    plot.dashes([0.5, 0.0], [0.5, 3.0]);
    plot.dots(r.null.iter().map(|v| [*v, 1.0]), COLOURS[0]);
    plot.line(r.interval.iter().map(|v| [*v, 2.0]), COLOURS[1]);
    plot.dots([[r.auc, 2.0]].into_iter(), COLOURS[1]);
    plot.finish()
}

fn scores(r: &TwoSample) -> String {
    const BINS: usize = 25;
    let bins = r.scores.each_ref().map(|scores| {
        let (mut bins, part) = (vec![0.0; BINS], 1.0 / scores.len().max(1) as f64);
        scores.iter().for_each(|s| bins[nearest(s * BINS as f64 - 0.5).min(BINS - 1)] += part);
        bins
    });
    let names = ["Scores of rows not learnt from", "how synthetic it looks", "part"];
    let mut plot = Plot::new(names, [0.0, 1.0].into_iter(), bins.iter().flatten().copied().chain([0.0]));
    for (bins, colour) in bins.iter().zip(COLOURS) {
        plot.line(bins.iter().enumerate().map(|(i, v)| [(i as f64 + 0.5) / BINS as f64, *v]), colour);
    }
    plot.finish()
}

fn moments(page: &mut String, test: &Test<Moments>) {
    put!(page, "<h2>{}: {}</h2>", escape(&test.name), verdict(test.verdict));
    page.push_str(
        "<table><tr><th>descriptor</th><th>Q-Q slope (5 – 95 %)</th><th>between real halves (0.25 – 99.75 %)</th><th>shift, sd (5 – 95 %)</th>\
         <th>between real halves</th></tr>",
    );
    for d in &test.result.descriptors {
        let numbers = [d.slope, d.null_slope, d.shift, d.null_shift]
            .map(|[low, middle, high]| format!("{middle:.2} ({low:.2} – {high:.2})"));
        row(page, d.within, std::iter::once(escape(&d.name)).chain(numbers));
    }
    page.push_str("</table><div class=\"plots\">");
    for d in &test.result.descriptors {
        let all: Vec<f64> = d.quantiles.iter().flatten().copied().collect();
        let (low, high) = all.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
        let mut plot = Plot::new([&d.name, "synthetic", "real"], all.iter().copied(), all.iter().copied());
        plot.dashes([low, low], [high, high]);
        plot.dots(d.quantiles.iter().map(|q| [q[1], q[0]]), COLOURS[1]);
        page.push_str(&plot.finish());
    }
    page.push_str("</div><p class=\"note\">Quantiles of all nuclei of either side; the slopes are those of random draws of as many as the heading says. Steeper than the dashes: real nuclei spread more.</p>");
}

fn beside(page: &mut String, beside: &Beside) {
    page.push_str("<h2>Field statistics</h2><div class=\"plots\">");
    for curve in &beside.curves {
        page.push_str(&drawn(curve));
    }
    page.push_str(
        "</div><table><tr><th>statistic</th><th class=\"real\">real p10</th><th class=\"real\">p50</th><th class=\"real\">p90</th>\
         <th class=\"synthetic\">synthetic p10</th><th class=\"synthetic\">p50</th><th class=\"synthetic\">p90</th></tr>",
    );
    for s in &beside.scalars {
        let numbers = [s.real, s.synthetic].into_iter().flat_map(|side| [side.p10, side.p50, side.p90]).map(known);
        row(page, s.within, std::iter::once(escape(&s.name)).chain(numbers));
    }
    page.push_str("</table><p class=\"note\">Over fields. Red: the synthetic median lies outside the real 10th to 90th percentile.</p>");
}

fn drawn(curve: &Curve) -> String {
    let points = |spreads: &[Spread], of: fn(&Spread) -> Option<f64>| -> Vec<[f64; 2]> {
        curve.at.iter().zip(spreads).map(|(x, s)| [*x, of(s).unwrap_or(f64::NAN)]).collect()
    };
    let all = curve.real.iter().chain(&curve.synthetic).flat_map(|s| [s.p10, s.p90]).flatten();
    let mut plot = Plot::new([&curve.name, &curve.along, ""], curve.at.iter().copied(), all);
    for (spreads, colour) in [&curve.real, &curve.synthetic].into_iter().zip(COLOURS) {
        plot.band(&points(spreads, |s| s.p10), &points(spreads, |s| s.p90), colour);
        plot.line(points(spreads, |s| s.p50).into_iter(), colour);
    }
    plot.finish()
}

fn png(grey: &[u8], width: usize) -> Vec<u8> {
    let mut out = Vec::new();
    let size = [width, grey.len() / width.max(1)].map(crate::number::id);
    let mut encoder = png::Encoder::new(&mut out, size[0], size[1]);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Eight);
    // Crops are at least a pixel, and memory takes what is written to it.
    let _ = encoder.write_header().and_then(|mut writer| writer.write_image_data(grey));
    out
}
