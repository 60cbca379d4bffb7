//! The study's tables: for people, as CSV, as JSON.

use super::savings::EQUAL;
use super::{Findings, Row, Savings, Side};
use std::fmt::Write as _;

impl Findings {
    /// As JSON.
    pub fn json(&self) -> String {
        serde_json::to_string_pretty(self).unwrap_or_default()
    }

    /// As tables for people.
    pub fn table(&self) -> String {
        let mut t = String::new();
        // Writing to a String cannot fail.
        if let Some(first) = self.tests.first() {
            let model = format!("{:?}", self.model).to_lowercase();
            let _ = writeln!(
                t,
                "Tables 3 and 4 of the thesis, --model {model}, {} seed(s) of the duality from {}",
                first.counts.len(),
                self.seed
            );
            let _ = writeln!(t, "{:40}{:>18}{:>20}{:>24}", "", "seconds", "memory, MB", "regions created");
            let _ = writeln!(
                t,
                "{:<8}{:>8}{:>12}{:>10}  {:>8}{:>10}{:>10}{:>10}{:>10}{:>14}",
                "test", "regions", "photons", "estimate", "thesis", "ours", "thesis", "ours", "thesis", "ours"
            );
            for r in &self.tests {
                let _ = writeln!(t, "{}", row(r));
            }
            let sum: f64 = self.tests.iter().map(|r| r.seconds).sum();
            let theirs: f64 = self.tests.iter().filter_map(|r| r.thesis.seconds).sum();
            let _ = writeln!(t, "{:<38}  {theirs:>8.0}{sum:>10.1}", "sum");
            if let Some(r) = self.tests.iter().find(|r| r.thesis.seconds.is_none()) {
                let gather = format!("{:?}", r.gather).to_lowercase();
                let (width, height) = (r.render.width, r.render.height);
                let _ = writeln!(
                    t,
                    "The thesis gives the cumulus neither a time nor a size; here it is {width} x {height}, --gather {gather}."
                );
            }
        }
        if let Some(first) = self.savings.first() {
            if !t.is_empty() {
                t.push('\n');
            }
            let _ = writeln!(
                t,
                "What the duality saves and loses: {} photons, {} in an estimate, --model physical; against the path tracer's picture of the layout",
                first.photons, first.estimate
            );
            let _ = writeln!(
                t,
                "{:<26}{:>9}{:>10}{:>9}{:>9}{:>12}{:>10}{:>10}{:>10}{:>18}",
                "", "regions", "queries", "seconds", "error", "queries", "seconds", "mean", "8x8 rms", "sunlight through"
            );
            let _ = writeln!(t, "{:<26}{:>9}{:>10}{:>9}{:>9}{:>22}", "", "", "", "", "", format!("at {:.0} % error", 100.0 * EQUAL));
            for s in &self.savings {
                t += &savings(s);
            }
        }
        t
    }

    /// Tables 3 and 4 as CSV.
    pub fn tests_csv(&self) -> String {
        let mut t = String::from(
            "test,regions,photons,estimate,thesis_seconds,seconds,thesis_megabytes,megabytes,thesis_created,created_mean,created_deviation\n",
        );
        for r in &self.tests {
            let some = |x: Option<f64>| x.map_or(String::new(), |x| x.to_string());
            let _ = writeln!(
                t,
                "{},{},{},{},{},{:.3},{},{:.1},{},{},{}",
                r.test,
                r.regions,
                r.photons,
                r.estimate,
                some(r.thesis.seconds),
                r.seconds,
                r.thesis.megabytes,
                r.peak_memory as f64 / 1e6,
                r.thesis.made,
                r.mean,
                some(r.deviation)
            );
        }
        t
    }

    /// Research question 2 as CSV, a line for each picture.
    pub fn savings_csv(&self) -> String {
        let mut t = String::from(
            "layout,shown,regions,queries,seconds,relative_error,queries_at_equal,seconds_at_equal,mean_difference,block_difference,sunlight\n",
        );
        for s in &self.savings {
            for (name, side) in s.sides() {
                let _ = writeln!(
                    t,
                    "{},{name},{},{},{:.3},{:.5},{:.0},{:.3},{:.5},{:.5},{:.5}",
                    s.regions,
                    side.regions,
                    side.queries,
                    side.seconds,
                    side.relative_error,
                    side.queries_at_equal,
                    side.seconds_at_equal,
                    side.mean_difference,
                    side.block_difference,
                    side.sunlight.value
                );
            }
        }
        t
    }
}

impl Savings {
    fn sides(&self) -> [(&'static str, &Side); 2] {
        [("layout", &self.source), ("duality", &self.duality)]
    }
}

/// A test's line.
pub(super) fn row(r: &Row) -> String {
    let seconds = r.thesis.seconds.map_or("-".into(), |s| format!("{s:.0}"));
    let spread = r.deviation.map_or(String::new(), |d| format!(" +- {d:.1}"));
    format!(
        "{:<8}{:>8}{:>12}{:>10}  {seconds:>8}{:>10.1}{:>10.0}{:>10.0}{:>10.0}{:>14}",
        r.test,
        r.regions,
        r.photons,
        r.estimate,
        r.seconds,
        r.thesis.megabytes,
        r.peak_memory as f64 / 1e6,
        r.thesis.made,
        format!("{:.1}{spread}", r.mean)
    )
}

/// The two lines of a layout.
pub(super) fn savings(s: &Savings) -> String {
    let line = |(name, side): (&str, &Side)| {
        format!(
            "{:<26}{:>9}{:>10}{:>9.1}{:>7.1} %{:>12.0}{:>10.1}{:>+8.1} %{:>8.1} %{:>18}\n",
            format!("{} region(s), {name}", s.regions),
            side.regions,
            side.queries,
            side.seconds,
            100.0 * side.relative_error,
            side.queries_at_equal,
            side.seconds_at_equal,
            100.0 * side.mean_difference,
            100.0 * side.block_difference,
            format!("{:.2} +- {:.2} %", 100.0 * side.sunlight.value, 100.0 * side.sunlight.se)
        )
    };
    s.sides().map(line).concat()
}
