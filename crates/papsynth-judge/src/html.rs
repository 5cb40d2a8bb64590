//! The report as a self-contained HTML page.

use std::fmt::Write;

use base64::Engine;
use base64::prelude::BASE64_STANDARD;

use crate::crops::Sheet;
use crate::judge::{Conclusion, Curve, FieldComparison, Percentiles, Report, Test};
use crate::moments::Moments;
use crate::number::nearest;
use crate::svg::{COLOURS, Plot, escape, short};
use crate::two_sample::TwoSample;

/// Number of features in a table.
const LISTED: usize = 30;

const STYLE: &str = "body{font:15px/1.45 system-ui,sans-serif;margin:2em auto;max-width:1240px;padding:0 1em;color:#222}\
h1{font-size:1.5em}h2{margin-top:2em;border-bottom:1px solid #ccc}table{border-collapse:collapse;font-size:13px}\
td,th{padding:2px 9px;text-align:right;border-bottom:1px solid #eee}td:first-child,th:first-child{text-align:left}\
svg text{font:11px system-ui,sans-serif;fill:#333}svg .title{font-weight:600;font-size:12px}\
.different{color:#b03000;font-weight:600}.similar{color:#00704a;font-weight:600}.out{color:#b03000}\
.real{color:#0072b2}.synthetic{color:#d55e00}.plots{display:flex;flex-wrap:wrap;gap:14px}\
.crops{display:flex;flex-wrap:wrap;gap:5px}.crops figure{margin:0;font-size:10px;text-align:center;color:#666}\
.nuclei img{width:80px;image-rendering:pixelated}.patches img{width:150px}.note{color:#555}.warning{color:#b03000}.about{text-align:left}";

/// Adds text to a page. Writing to a string cannot fail.
macro_rules! put {
    ($page:expr, $($text:tt)*) => {{
        let _ = write!($page, $($text)*);
    }};
}

impl Report {
    /// Returns the report as an HTML page that loads no other files. It shows crops of the images.
    #[must_use]
    pub fn to_html(&self) -> String {
        let mut page = String::new();
        let [real, synthetic] = self.fields.each_ref().map(Vec::len);
        let nuclei = match self.measurement.nuclei_from {
            crate::NucleiFrom::Masks => "from masks",
            crate::NucleiFrom::Points => "at annotated points",
            crate::NucleiFrom::Search => "segmented",
        };
        put!(
            page,
            "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><title>papsynth judge</title><style>{STYLE}</style></head><body>\
             <h1>{real} real fields and {synthetic} synthetic fields: {}</h1>",
            conclusion(self.conclusion)
        );
        put!(
            page,
            "<p>Pixel size {} µm; nuclei {nuclei}; seed {}. Colours: <span class=\"real\">real</span>, \
             <span class=\"synthetic\">synthetic</span>.</p>",
            self.measurement.pixel_um,
            self.judge.seed
        );
        for warning in &self.warnings {
            put!(page, "<p class=\"warning\">Warning: {}</p>", escape(warning));
        }
        summary(&mut page, self);
        for test in &self.two_sample {
            two_sample(&mut page, test, &self.crops);
        }
        for test in &self.moments {
            moments(&mut page, test);
        }
        field_comparison(&mut page, &self.field_comparison);
        page.push_str("</body></html>\n");
        page
    }
}

fn conclusion(conclusion: Conclusion) -> String {
    let class = if conclusion == Conclusion::Distinguishable { "different" } else { "similar" };
    format!("<span class=\"{class}\">{conclusion}</span>")
}

/// Adds a table row; red if the value is outside the expected range.
fn row(page: &mut String, within: bool, cells: impl IntoIterator<Item = String>) {
    page.push_str(if within { "<tr>" } else { "<tr class=\"out\">" });
    cells.into_iter().for_each(|cell| put!(page, "<td>{cell}</td>"));
    page.push_str("</tr>");
}

fn summary(page: &mut String, report: &Report) {
    page.push_str("<h2>Tests</h2><table><tr><th>test</th><th>objects</th><th>AUC</th><th>95 % interval</th><th>between real halves</th><th>conclusion</th></tr>");
    for test in &report.two_sample {
        let TwoSample { rows: [real, synthetic], auc, interval: [low, high], null, null_rows, .. } = &test.result;
        let null = Percentiles::of(null.iter().copied());
        let [p10, p50, p90] = [null.p10, null.p50, null.p90].map(known);
        let cells = [
            format!("classifier on {}", escape(&test.name)),
            format!("{real} / {synthetic}"),
            format!("{auc:.3}"),
            format!("{low:.3} – {high:.3}"),
            format!("{p50} ({p10} – {p90}), {null_rows} objects per half"),
            conclusion(test.conclusion),
        ];
        row(page, true, cells);
    }
    for test in &report.moments {
        let Moments { n, descriptors } = &test.result;
        let outside = descriptors.iter().filter(|d| !d.within).count();
        let slopes: Vec<String> = descriptors.iter().map(|d| format!("{:.2}", d.slope[1])).collect();
        let name = format!("Q-Q slopes, {}", escape(&test.name));
        let outside = format!("{outside} of {} descriptors outside", descriptors.len());
        row(page, true, [name, n.to_string(), String::new(), slopes.join(" "), outside, conclusion(test.conclusion)]);
    }
    page.push_str(
        "</table><p class=\"note\">AUC is the area under the ROC curve of a random forest: 0.5 is chance level, 1 is a perfect separation. \
         Cross-validation never splits a field. A classifier test concludes “distinguishable” if its AUC exceeds 95 of 100 AUCs between random \
         halves of the real fields and its 95 % interval (bootstrap over fields) excludes 0.5. A Q-Q test concludes “distinguishable” if a slope \
         or a shift of medians is outside the range of 199 of 200 pairs of disjoint real halves with the same number of nuclei. By chance this \
         happens in at most 1 of 17 comparisons.</p>",
    );
}

fn known(value: Option<f64>) -> String {
    value.map_or_else(|| "–".to_owned(), short)
}

fn two_sample(page: &mut String, test: &Test<TwoSample>, crops: &[Sheet]) {
    let r = &test.result;
    let (name, auc, conclusion) = (escape(&test.name), r.auc, conclusion(test.conclusion));
    put!(
        page,
        "<h2>Features that distinguish {name}</h2><p>AUC {auc:.2}, {conclusion}: {}. AUC with the features of one kind only: ",
        escape(&r.meaning)
    );
    let kinds: Vec<String> = r.kinds.iter().map(|f| format!("{} {:.2}", f.kind.name(), f.auc)).collect();
    put!(page, "{}.</p><div class=\"plots\">{}{}</div>", kinds.join(", "), strip(r), scores(r));
    page.push_str(
        "<table><tr><th>feature</th><th>importance</th><th>AUC of the feature</th><th class=\"real\">real p10</th><th class=\"real\">p50</th><th class=\"real\">p90</th>\
         <th class=\"synthetic\">synthetic p10</th><th class=\"synthetic\">p50</th><th class=\"synthetic\">p90</th>\
         <th class=\"real\">sd between fields</th><th class=\"synthetic\">sd between fields</th></tr>",
    );
    for g in r.distinguishing_features.iter().take(LISTED) {
        let name = format!("<span title=\"{}\">{}</span>", escape(&g.feature), escape(&g.description));
        let first = [name, format!("{:.0} %", 100.0 * g.importance), format!("{:.2}", g.single_auc)];
        let numbers = g.real.iter().chain(&g.synthetic).chain(&g.between_fields);
        row(page, true, first.into_iter().chain(numbers.map(|v| short(*v))));
    }
    page.push_str(
        "</table><p class=\"note\">Importance: the loss of separation when the values of the feature are permuted among test rows, as a fraction of the \
         losses of all features. Correlated features share their importance. The AUC of the feature is above 0.5 if its values are larger in \
         synthetic fields. sd between fields: standard deviation of the medians of fields.</p>",
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
    let names = ["AUC with 95 % interval", "AUC", "1: between real halves, 2: between sides"];
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
    let names = ["Scores of test rows", "0: looks real, 1: looks synthetic", "fraction"];
    let mut plot = Plot::new(names, [0.0, 1.0].into_iter(), bins.iter().flatten().copied().chain([0.0]));
    for (bins, colour) in bins.iter().zip(COLOURS) {
        plot.line(bins.iter().enumerate().map(|(i, v)| [(i as f64 + 0.5) / BINS as f64, *v]), colour);
    }
    plot.finish()
}

fn moments(page: &mut String, test: &Test<Moments>) {
    put!(page, "<h2>{}: {}</h2>", escape(&test.name), conclusion(test.conclusion));
    page.push_str(
        "<table><tr><th>descriptor</th><th>Q-Q slope (5 – 95 %)</th><th>between real halves (0.25 – 99.75 %)</th><th>shift of the median, sd (5 – 95 %)</th>\
         <th>between real halves</th></tr>",
    );
    for d in &test.result.descriptors {
        let numbers = [d.slope, d.null_slope, d.shift, d.null_shift]
            .map(|[low, middle, high]| format!("{middle:.2} ({low:.2} – {high:.2})"));
        row(page, d.within, std::iter::once(escape(&d.description)).chain(numbers));
    }
    page.push_str("</table><div class=\"plots\">");
    for d in &test.result.descriptors {
        let all: Vec<f64> = d.quantiles.iter().flatten().copied().collect();
        let (low, high) = all.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
        let mut plot = Plot::new([&d.description, "synthetic", "real"], all.iter().copied(), all.iter().copied());
        plot.dashes([low, low], [high, high]);
        plot.dots(d.quantiles.iter().map(|q| [q[1], q[0]]), COLOURS[1]);
        page.push_str(&plot.finish());
    }
    page.push_str("</div><p class=\"note\">Quantiles of all nuclei of each side; the slopes are medians over random draws of the number of nuclei in the heading. Steeper than the dashed line: real nuclei vary more.</p>");
}

fn field_comparison(page: &mut String, comparison: &FieldComparison) {
    page.push_str("<h2>Field statistics</h2><div class=\"plots\">");
    for curve in &comparison.curves {
        page.push_str(&drawn(curve));
    }
    page.push_str(
        "</div><table><tr><th>statistic</th><th class=\"real\">real p10</th><th class=\"real\">p50</th><th class=\"real\">p90</th>\
         <th class=\"synthetic\">synthetic p10</th><th class=\"synthetic\">p50</th><th class=\"synthetic\">p90</th></tr>",
    );
    for s in &comparison.scalars {
        let numbers = [s.real, s.synthetic].into_iter().flat_map(|side| [side.p10, side.p50, side.p90]).map(known);
        row(page, s.within, std::iter::once(escape(&s.description)).chain(numbers));
    }
    page.push_str("</table><p class=\"note\">Percentiles over fields. Red: the synthetic median is outside the real 10th to 90th percentile.</p>");
}

fn drawn(curve: &Curve) -> String {
    let points = |spreads: &[Percentiles], of: fn(&Percentiles) -> Option<f64>| -> Vec<[f64; 2]> {
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
    // Writing to memory cannot fail, and a crop has at least one pixel.
    let _ = encoder.write_header().and_then(|mut writer| writer.write_image_data(grey));
    out
}
