//! Numbers as they stand in files, and what stands there instead.

use super::Defect;

/// A coordinate: NaN for what the programs of this world print for infinite and undefined numbers, and for what is
/// beyond double precision; `None` for anything else that is not a number.
#[inline]
pub(super) fn coordinate(word: &[u8]) -> Option<f64> {
    let text = str::from_utf8(word).ok()?;
    match text.parse::<f64>() {
        Ok(number) => Some(if number.is_finite() { number } else { f64::NAN }),
        Err(_) => is_undefined(text).then_some(f64::NAN),
    }
}

/// Spellings of infinite and undefined numbers that Rust does not know (it knows `inf`, `infinity` and `nan`), in lower
/// case.
const UNDEFINED: [&str; 18] = [
    "\u{221e}", // .NET since 3.0
    "nanq",     // AIX
    "nans",
    "nan?",
    "infinite",
    "complexinfinity", // Mathematica
    "indeterminate",
    "undefined", // JavaScript
    "null",
    "nil",
    "none", // Python
    "na",   // R
    "<na>", // pandas
    "n/a",
    "1.$",  // Microsoft's `1.#IND` and `1.#QNAN` rounded to one digit
    ".inf", // YAML
    ".nan",
    "1/0",
];

/// Whether some library prints `text` for an infinite or undefined number.
fn is_undefined(text: &str) -> bool {
    // NumPy's masked arrays.
    if text == "--" {
        return true;
    }
    let text = text.trim_start_matches(['+', '-']).to_ascii_lowercase();
    // Microsoft's until 2015, cut or filled up to the digits asked for: 1.#INF00, 1.#QNAN, 1.#IND, 1.#J, 1.#R.
    let microsoft = || text.strip_prefix("1.#").is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_alphabetic()));
    // C's, with what is inside: nan(ind), nan(0x8000000000000).
    let c = || text.starts_with("nan(") && text.ends_with(')');
    // Fortran's for a number that is wider than its field.
    let fortran = || text.starts_with('*') && text.trim_matches('*').is_empty();
    UNDEFINED.contains(&&*text) || microsoft() || c() || fortran()
}

/// The part of a face's corner before the first slash.
#[inline]
pub(super) fn vertex_part(word: &[u8]) -> &[u8] {
    word.split(|&byte| byte == b'/').next().unwrap_or_default()
}

/// A whole number; one with too many digits becomes the largest of its sign, which no file has vertices for.
#[inline]
pub(super) fn index(text: &[u8]) -> Option<i64> {
    let (negative, digits) = match text {
        [b'-', digits @ ..] => (true, digits),
        [b'+', digits @ ..] => (false, digits),
        digits => (false, digits),
    };
    if digits.is_empty() {
        return None;
    }
    // One less than the limits, so that a vertex count can be added without overflow.
    const LARGEST: i64 = i64::MAX / 2;
    let mut number = 0_i64;
    for digit in digits {
        if !digit.is_ascii_digit() {
            return None;
        }
        number = number.saturating_mul(10).saturating_add(i64::from(digit - b'0')).min(LARGEST);
    }
    Some(if negative { -number } else { number })
}

/// The defect of a word that is not the number which belongs there.
pub(super) fn defect(word: &[u8]) -> Defect {
    let hint = if !word.is_ascii() {
        " (digits, signs, spaces and line ends are read in ASCII alone)"
    } else if word.contains(&b',') {
        " (numbers are read with a decimal point, not a comma)"
    } else if word.iter().any(|byte| matches!(byte, b'd' | b'D')) && word.iter().any(u8::is_ascii_digit) {
        " (exponents are read with an e)"
    } else {
        ""
    };
    Defect::Number { text: shorten(word), hint }
}

/// At most 40 characters of a word; those that do not print, or look like others, are written as escapes.
pub(super) fn shorten(word: &[u8]) -> String {
    const LONGEST: usize = 40;
    let mut text = String::new();
    for chunk in word[..word.len().min(4 * LONGEST)].utf8_chunks() {
        for character in chunk.valid().chars() {
            if character.is_ascii_graphic() {
                text.push(character);
            } else {
                text.extend(character.escape_unicode());
            }
        }
        text.extend(chunk.invalid().iter().map(|byte| format!("\\x{byte:02x}")));
    }
    match text.char_indices().nth(LONGEST) {
        Some((end, _)) => text[..end].to_owned() + "…",
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_as_anybody_writes_them() {
        for (text, number) in
            [("1", 1.0), ("-0.5", -0.5), ("+2", 2.0), (".5", 0.5), ("5.", 5.0), ("1.e3", 1e3), ("1E+05", 1e5)]
        {
            assert_eq!(coordinate(text.as_bytes()), Some(number), "{text}");
        }
        // More digits than single precision holds.
        assert_eq!(coordinate(b"5412345.250"), Some(5_412_345.25));
    }

    #[test]
    fn what_libraries_print_for_undefined_numbers_is_known() {
        let undefined = "nan -nan NaN +NAN nan(ind) -nan(ind) nan(snan) nan(0x8000000000000) NaNQ -NaNS nan? \
            inf -inf +Inf INF Infinity -Infinity infinite \u{221e} -\u{221e} 1e999 -1e400 \
            1.#INF -1.#INF 1.#INF00 1.#INF000e+000 1.#QNAN -1.#QNAN 1.#QNAN0 1.#SNAN 1.#IND -1.#IND00 1.#J -1.#R 1.$ \
            none None null undefined NA N/A <NA> -- ComplexInfinity Indeterminate .nan -.inf ********* 1/0";
        for text in undefined.split_whitespace() {
            assert!(coordinate(text.as_bytes()).is_some_and(f64::is_nan), "{text}");
        }
        for text in
            ["", "+", "-", "x", "nano", "1.#", "1.#5", "1.2.3", "1e", "0x10", "1,5", "1_0", "1f", "\u{2212}1", "nan("]
        {
            assert_eq!(coordinate(text.as_bytes()), None, "{text}");
        }
    }

    #[test]
    fn indices_are_whole_numbers() {
        let all = [("1", 1), ("-2", -2), ("+3", 3), ("0", 0), ("007", 7)];
        for (text, number) in all {
            assert_eq!(index(text.as_bytes()), Some(number), "{text}");
        }
        assert!(index(b"99999999999999999999999").is_some_and(|i| i > i64::from(u32::MAX)));
        assert!(index(b"-9223372036854775808").is_some_and(|i| i < -i64::from(u32::MAX)));
        for text in ["", "-", "1.5", "x", "1e3", "--1"] {
            assert_eq!(index(text.as_bytes()), None, "{text}");
        }
        assert_eq!((vertex_part(b"1/2/3"), vertex_part(b"1"), vertex_part(b"/1")), (&b"1"[..], &b"1"[..], &b""[..]));
    }

    #[test]
    fn defects_say_what_they_may_come_from() {
        let text = |word: &[u8]| defect(word).to_string();
        assert!(text(b"2,5").contains("not a comma"));
        assert!(text(b"1.0D+05").contains("with an e"));
        assert!(text("1\u{a0}2".as_bytes()).starts_with("'1\\u{a0}2' is not a number (digits"));
        assert!(text(b"1\xa02").starts_with("'1\\xa02' is not"));
        assert_eq!(text(b"x"), "'x' is not a number");
        assert_eq!(shorten(&[b'x'; 100]), "x".repeat(40) + "…");
    }
}
