//! How numbers on the command line are read.

/// A whole number, with k, M, G or an exponent.
pub(super) fn count(text: &str) -> Result<u64, String> {
    let (digits, unit) = match text.char_indices().last() {
        Some((i, 'k' | 'K')) => (&text[..i], 1e3),
        Some((i, 'm' | 'M')) => (&text[..i], 1e6),
        Some((i, 'g' | 'G')) => (&text[..i], 1e9),
        _ => (text, 1.0),
    };
    let value = digits.parse::<f64>().map_err(|_| format!("{text:?} is not a number such as 500000, 500k, 10M or 1e6"))? * unit;
    if value.fract() == 0.0 && (0.0..=9e15).contains(&value) {
        Ok(value as u64)
    } else {
        Err(format!("{text:?} is not a whole number from 0 to 9e15"))
    }
}

/// A length above zero.
pub(super) fn length(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err(format!("{text:?} is not a length in metres above 0")),
    }
}

/// A relative error, given in per cent.
pub(super) fn percent(text: &str) -> Result<f64, String> {
    match text.trim_end_matches('%').parse::<f64>() {
        Ok(value) if (0.05..=50.0).contains(&value) => Ok(value / 100.0),
        _ => Err(format!("{text:?} is not an error from 0.05% to 50%")),
    }
}

/// A time, in seconds, minutes or hours.
pub(super) fn time(text: &str) -> Result<f64, String> {
    let (digits, unit) = match text.char_indices().last() {
        Some((i, 's')) => (&text[..i], 1.0),
        Some((i, 'm')) => (&text[..i], 60.0),
        Some((i, 'h')) => (&text[..i], 3600.0),
        _ => (text, 1.0),
    };
    match digits.parse::<f64>().map(|value| value * unit) {
        Ok(value) if (0.1..=1e7).contains(&value) => Ok(value),
        _ => Err(format!("{text:?} is not a time from 0.1s up, such as 30s, 5m or 1h")),
    }
}

/// A size in millions of bytes.
pub(super) fn megabytes(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.01..=1e6).contains(&value) => Ok(value),
        _ => Err(format!("{text:?} is not a size from 0.01 to 1e6 MB")),
    }
}

/// An optical depth above zero.
pub(super) fn step(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value >= 1e-6 && value.is_finite() => Ok(value),
        _ => Err(format!("{text:?} is not an optical depth from 1e-6 up")),
    }
}

/// A finite number of stops.
pub(super) fn stops(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.abs() <= 100.0 => Ok(value),
        _ => Err(format!("{text:?} is not a number of stops from -100 to 100")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_read_as_people_write_them() {
        assert_eq!(
            [count("10M"), count("1e6"), count("250k"), count("7"), count("1.5M")],
            [Ok(10_000_000), Ok(1_000_000), Ok(250_000), Ok(7), Ok(1_500_000)]
        );
        assert!(["", "x", "-1", "1.5", "nan", "inf", "1e300", "é"].iter().all(|t| count(t).is_err()));
    }

    #[test]
    fn times_have_units() {
        assert_eq!([time("30s"), time("1.5m"), time("1h"), time("12")], [Ok(30.0), Ok(90.0), Ok(3600.0), Ok(12.0)]);
        assert!(["0s", "-1s", "nan", "s", "", "1d", "1e9h", "infs"].iter().all(|t| time(t).is_err()));
    }

    #[test]
    fn lengths_are_finite_and_above_zero() {
        assert_eq!(length("0.25"), Ok(0.25));
        assert!(["0", "-1", "nan", "inf", "1m", ""].iter().all(|t| length(t).is_err()));
    }
}
