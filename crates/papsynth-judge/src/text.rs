//! The report as plain text for a terminal.

use crate::judge::{Conclusion, Report};

/// Features to print for each test.
const PRINTED: usize = 5;

impl Report {
    /// Returns a summary as plain text: warnings, then each test with its conclusion and the most important features.
    #[must_use]
    pub fn to_text(&self) -> String {
        let mut text = String::new();
        for warning in &self.warnings {
            text.push_str(&format!("warning: {warning}\n"));
        }
        for test in &self.two_sample {
            let (name, r, conclusion, [low, high]) = (&test.name, &test.result, test.conclusion, test.result.interval);
            let halves = r.null_median().map_or("unknown (too few fields)".to_owned(), |auc| format!("{auc:.2}"));
            text.push_str(&format!(
                "{name:<10} AUC {:.2} (95 % interval {low:.2} to {high:.2}; between real halves {halves}): {conclusion}\n    {}\n",
                r.auc, r.meaning
            ));
            let told = test.conclusion == Conclusion::Distinguishable;
            let shown = r.distinguishing_features.iter().take(PRINTED).filter(|f| told && f.importance >= 0.005);
            for (i, f) in shown.enumerate() {
                if i == 0 {
                    text.push_str(&format!("    {:>10}  {:>10} {:>10}  feature\n", "importance", "real", "synthetic"));
                }
                text.push_str(&format!(
                    "    {:>8.0} %  {:>10} {:>10}  {}\n",
                    100.0 * f.importance,
                    crate::svg::short(f.real[1]),
                    crate::svg::short(f.synthetic[1]),
                    f.description
                ));
            }
        }
        for test in &self.moments {
            let outside = test.result.descriptors.iter().filter(|d| !d.within).count();
            let of = test.result.descriptors.len();
            text.push_str(&format!(
                "{}: {outside} of {of} descriptors outside the range of real halves: {}\n",
                test.name, test.conclusion
            ));
        }
        let [real, synthetic] = self.fields.each_ref().map(Vec::len);
        let conclusion = self.conclusion;
        text.push_str(&format!("{real} real fields and {synthetic} synthetic fields: {conclusion}\n"));
        text
    }
}
