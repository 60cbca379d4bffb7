//! Numbers as sentences have them.

/// Three significant digits: 0.0525, 41.3, 5260, 1.2e6.
pub fn figure(value: f64) -> String {
    let magnitude = value.abs();
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    if !(1e-3..1e6).contains(&magnitude) {
        let text = format!("{value:.2e}");
        let (digits, power) = text.split_once('e').unwrap_or((&text, "0"));
        return format!("{}e{power}", trimmed(digits));
    }
    let before = magnitude.log10().floor() as i32;
    let text = format!("{value:.*}", (2 - before).max(0) as usize);
    trimmed(&text).into()
}

fn trimmed(text: &str) -> &str {
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { text }
}

/// 640 bytes, 12.3 kB, 1.2 MB, 4.5 GB.
pub fn size(bytes: f64) -> String {
    match bytes {
        b if b >= 1e9 => format!("{} GB", figure(b / 1e9)),
        b if b >= 1e6 => format!("{} MB", figure(b / 1e6)),
        b if b >= 1e3 => format!("{} kB", figure(b / 1e3)),
        b => format!("{b} bytes"),
    }
}

/// One thing, or a number of them: `1 value`, `3 values`.
pub fn count(number: u64, thing: &str) -> String {
    format!("{number} {thing}{}", if number == 1 { "" } else { "s" })
}
