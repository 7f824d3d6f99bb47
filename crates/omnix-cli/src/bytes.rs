//! Sizes on the command line: `4GiB`, `512MiB`, `1.5GB`, `65536`.

/// Bytes of a size with a unit. `K`, `M`, `G` and `T` alone are binary, as are `KiB` and so on; `KB` and so on are decimal.
pub(crate) fn parse(text: &str) -> Result<u64, String> {
    let text = text.trim();
    let split = text.find(|c: char| !(c.is_ascii_digit() || c == '.')).unwrap_or(text.len());
    let (number, unit) = text.split_at(split);
    let unit: u64 = match unit.trim().to_ascii_lowercase().as_str() {
        "" | "b" => 1,
        "k" | "kib" => 1 << 10,
        "m" | "mib" => 1 << 20,
        "g" | "gib" => 1 << 30,
        "t" | "tib" => 1 << 40,
        "kb" => 1_000,
        "mb" => 1_000_000,
        "gb" => 1_000_000_000,
        "tb" => 1_000_000_000_000,
        other => return Err(format!("unknown unit `{other}`: write 4GiB, 512MiB or plain bytes")),
    };
    let Ok(number) = number.parse::<f64>() else {
        return Err("write a number and a unit, such as 4GiB or 512MiB".to_owned());
    };
    let bytes = number * unit as f64;
    if bytes >= 1.0 && bytes < u64::MAX as f64 { Ok(bytes as u64) } else { Err("not a possible size".to_owned()) }
}

/// For people: `312 MiB`, `2.3 GiB`.
pub(crate) fn show(bytes: u64) -> String {
    let mib = bytes as f64 / f64::from(1u32 << 20);
    match mib {
        m if m >= 1024.0 => format!("{:.1} GiB", m / 1024.0),
        m if m >= 1.0 => format!("{:.0} MiB", m.ceil()),
        _ => format!("{} KiB", bytes.div_ceil(1024)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes() {
        assert_eq!(parse("4GiB"), Ok(4 << 30));
        assert_eq!(parse("4 gib"), Ok(4 << 30));
        assert_eq!(parse("1.5G"), Ok(3 << 29));
        assert_eq!(parse("2GB"), Ok(2_000_000_000));
        assert_eq!(parse("65536"), Ok(65_536));
        for bad in ["", "GiB", "4XB", "-1", "0", "1..2", "nan", "1e400"] {
            assert!(parse(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn shown_rounded() {
        assert_eq!(show(1), "1 KiB");
        assert_eq!(show(3 << 29), "1.5 GiB");
    }
}
