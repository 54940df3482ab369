//! Whether an array holds rays, and how one that does not can be made to.

use super::header::{Header, Plain, Type};
use super::{Fault, RAY_COLUMNS};

/// An array of rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    pub(super) rows: u64,
    pub(super) number: Number,
    /// Whether the file holds all first numbers, then all second ones and so on (Fortran order).
    pub(super) by_columns: bool,
}

/// How numbers are written: little-endian, in single or double precision.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Number {
    Single,
    Double,
}

impl Number {
    pub(super) const fn bytes(self) -> u64 {
        match self {
            Self::Single => 4,
            Self::Double => 8,
        }
    }
}

impl Layout {
    /// # Errors
    /// When the array holds no rays; the message says what it holds and what to save instead.
    pub(super) fn of(header: &Header) -> Result<Self, Fault> {
        let Header { type_of, by_columns, shape, written } = header;
        let number = match *type_of {
            Type::Plain(Plain { is_little_endian: true, kind: b'f', size: 4 }) => Some(Number::Single),
            Type::Plain(Plain { is_little_endian: true, kind: b'f', size: 8 }) => Some(Number::Double),
            _ => None,
        };
        match (number, &shape[..]) {
            (Some(_), &[rows, RAY_COLUMNS]) if rows > u64::from(u32::MAX) => Err(Fault::TooMany(rows)),
            (Some(number), &[rows, RAY_COLUMNS]) => Ok(Self { rows, number, by_columns: *by_columns }),
            _ => Err(Fault::NoRays { found: written.clone(), shape: shape.clone(), advice: advice(type_of, shape) }),
        }
    }
}

const ONE_ROW: &str = "one row is origin x y z, tmin, direction x y z, tmax";

/// What to do with an array of numbers of this type and shape.
fn advice(type_of: &Type, shape: &[u64]) -> String {
    let (numbers, shape) = match type_of {
        // The objects of a list may be rows.
        Type::Plain(plain) if plain.kind == b'O' && shape.len() == 1 => (converted(*plain), &[0, RAY_COLUMNS][..]),
        Type::Plain(plain) => (converted(*plain), shape),
        // Their fields become the last dimension.
        Type::Record(Some(RAY_COLUMNS)) => {
            let unstructured = "numpy.lib.recfunctions.structured_to_unstructured(rays, '<f8')";
            let rows: &[u64] = if shape.len() == 1 { &[0, RAY_COLUMNS] } else { &[0, 0, RAY_COLUMNS] };
            (Ok(unstructured), rows)
        }
        Type::Record(_) => (Err("its rows are not 8 numbers"), shape),
    };
    let numbers = match numbers {
        Ok(numbers) => numbers,
        Err(reason) => return format!("{reason}; {ONE_ROW}"),
    };
    match shaped(numbers, shape) {
        Some(rays) if shape.last() == Some(&RAY_COLUMNS) && shape.len() == 2 => format!("save `{rays}`"),
        Some(rays) => format!("save `{rays}`; {ONE_ROW}"),
        None => ONE_ROW.to_owned(),
    }
}

/// An expression for `rays` with numbers of a type that can be read, or why there is none.
const fn converted(plain: Plain) -> Result<&'static str, &'static str> {
    match (plain.kind, plain.size) {
        (b'f', 4 | 8) if plain.is_little_endian => Ok("rays"),
        // Whatever single precision holds.
        (b'f' | b'i' | b'u', 1 | 2) | (b'f', 4) | (b'b', _) => Ok("rays.astype('<f4')"),
        (b'f' | b'i' | b'u' | b'S' | b'U', _) => Ok("rays.astype('<f8')"),
        (b'O', _) => Ok("np.array(rays.tolist(), '<f8')"),
        (b'c', _) => Err("complex numbers are no rays"),
        _ => Err("its entries are no numbers"),
    }
}

/// An expression for an array of this shape with one ray in each row; `None` where nothing says which numbers are a
/// ray.
fn shaped(numbers: &str, shape: &[u64]) -> Option<String> {
    // In C order, as NumPy reshapes: the last dimensions that hold eight numbers together are a ray.
    let ends_in_rays = || {
        let mut product = 1_u64;
        shape.iter().rev().any(|&side| {
            product = product.saturating_mul(side);
            product == RAY_COLUMNS
        })
    };
    let without_ranges = |rays: &str| {
        format!("np.c_[{rays}[:, :3], np.zeros(len({rays})), {rays}[:, 3:], np.full(len({rays}), np.inf)]")
    };
    match *shape {
        [_, RAY_COLUMNS] => Some(numbers.to_owned()),
        [RAY_COLUMNS, _] => Some(format!("{numbers}.T")),
        // Origin and direction.
        [_, 6] => Some(without_ranges(numbers)),
        [6, _] => Some(without_ranges(&format!("{numbers}.T"))),
        [count] if count > 0 && count % RAY_COLUMNS == 0 => Some(format!("{numbers}.reshape(-1, 8)")),
        [_, _, _, ..] if ends_in_rays() => Some(format!("{numbers}.reshape(-1, 8)")),
        [RAY_COLUMNS, _, _, ..] => Some(format!("{numbers}.reshape(8, -1).T")),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(descr: &str, shape: &[u64]) -> String {
        let shape: Vec<String> = shape.iter().map(|side| format!("{side},")).collect();
        let dict = format!("{{'descr': {descr}, 'fortran_order': False, 'shape': ({}), }}\n", shape.join(" "));
        let mut file = b"\x93NUMPY\x01\x00".to_vec();
        file.extend((dict.len() as u16).to_le_bytes());
        file.extend(dict.bytes());
        Layout::of(&Header::read(&mut &file[..]).unwrap()).unwrap_err().to_string()
    }

    /// NumPy carries out each of these and gets the rays, none scrambled. Mutants: `reshape` for 8 × N, which scrambles
    /// them; a type that loses digits; types that are no numbers converted nevertheless.
    #[test]
    fn advice_is_right_for_the_array_at_hand() {
        let f4 = "'<f4'";
        for (descr, shape, advice) in [
            (f4, &[8, 7][..], "`rays.T`"),
            (f4, &[8, 6], "`rays.T`"),
            (
                f4,
                &[6, 8000],
                "`np.c_[rays.T[:, :3], np.zeros(len(rays.T)), rays.T[:, 3:], np.full(len(rays.T), np.inf)]`",
            ),
            (f4, &[2, 6], "`np.c_[rays[:, :3], np.zeros(len(rays)), rays[:, 3:], np.full(len(rays), np.inf)]`"),
            (f4, &[16], "`rays.reshape(-1, 8)`"),
            (f4, &[4, 5, 8], "`rays.reshape(-1, 8)`"),
            (f4, &[5, 2, 4], "`rays.reshape(-1, 8)`"),
            (f4, &[8, 4, 5], "`rays.reshape(8, -1).T`"),
            ("'>f4'", &[2, 8], "`rays.astype('<f4')`"),
            ("'>f8'", &[2, 8], "`rays.astype('<f8')`"),
            ("'<f2'", &[8, 2], "`rays.astype('<f4').T`"),
            ("'<f16'", &[2, 8], "`rays.astype('<f8')`"),
            ("'<i2'", &[2, 8], "`rays.astype('<f4')`"),
            ("'<i4'", &[16], "`rays.astype('<f8').reshape(-1, 8)`"),
            ("'<U5'", &[2, 8], "`rays.astype('<f8')`"),
            ("'|O'", &[2, 8], "`np.array(rays.tolist(), '<f8')`"),
            ("'|O'", &[5], "`np.array(rays.tolist(), '<f8')`"),
            (
                "[('o', '<f4', (3,)), ('n', '<f4'), ('d', '<f4', (3,)), ('f', '<f4')]",
                &[5],
                "`numpy.lib.recfunctions.structured_to_unstructured(rays, '<f8')`",
            ),
        ] {
            let message = refusal(descr, shape);
            assert!(message.contains(&format!("save {advice}")), "{descr} {shape:?}: {message}");
        }
        // Nothing makes rays of these; the row is explained.
        for (descr, shape) in [
            (f4, &[7][..]),
            (f4, &[3, 7]),
            (f4, &[]),
            ("'<c8'", &[2, 8]),
            ("'<M8[ns]'", &[2, 8]),
            ("[('x', '<f4'), ('y', '<f4')]", &[5]),
        ] {
            let message = refusal(descr, shape);
            assert!(message.contains(ONE_ROW) && !message.contains("save `"), "{descr} {shape:?}: {message}");
        }
    }
}
