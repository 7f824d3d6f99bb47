//! How numbers are shown in tables and plots.

/// Four significant digits, or a dash.
#[must_use]
pub(crate) fn number(value: f64) -> String {
    if !value.is_finite() {
        return "–".into();
    }
    let digits = if value == 0.0 { 1 } else { value.abs().log10().floor() as i32 + 1 };
    let decimals = (4 - digits).clamp(0, 6);
    format!("{value:.*}", decimals.unsigned_abs() as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits() {
        let shown = [0.0, 1234.56, 0.000_123_4, 99.999, -2.5, f64::INFINITY].map(number);
        assert_eq!(shown, ["0.000", "1235", "0.000123", "100.00", "-2.500", "–"]);
    }
}
