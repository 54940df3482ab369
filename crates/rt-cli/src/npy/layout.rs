//! Whether an array holds rays, and how one that does not can be made to.

use super::RAY_COLUMNS;
use anyhow::{Result, bail, ensure};
use npyz::{DType, NpyHeader, Order, TypeChar, TypeStr};

/// An array of rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    pub(super) rows: u64,
    pub(super) type_of: Type,
    /// Whether the file holds all first numbers, then all second ones and so on (Fortran order).
    pub(super) by_columns: bool,
}

/// How numbers are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Type {
    Single,
    Double,
}

impl Layout {
    /// # Errors
    /// When the array holds no rays; the message says what it holds and what to save instead.
    pub(super) fn of(header: &NpyHeader) -> Result<Self> {
        let (dtype, shape) = (header.dtype(), header.shape());
        let type_of = match dtype.descr().as_str() {
            "'<f4'" => Some(Type::Single),
            "'<f8'" => Some(Type::Double),
            _ => None,
        };
        let by_columns = header.order() == Order::Fortran;
        if let (Some(type_of), &[rows, RAY_COLUMNS]) = (type_of, shape) {
            ensure!(rows <= u64::from(u32::MAX), "{rows} rays are more than {}: split the file", u32::MAX);
            return Ok(Self { rows, type_of, by_columns });
        }
        bail!(
            "found {} of shape {shape:?}, wanted float32 or float64 ('<f4', '<f8') of shape [N, 8]: {}",
            dtype.descr(),
            advice(&dtype, shape)
        )
    }
}

const ONE_ROW: &str = "one row is origin x y z, tmin, direction x y z, tmax";

/// What to do with an array of numbers of this type and shape.
fn advice(dtype: &DType, shape: &[u64]) -> String {
    let (numbers, shape) = match dtype {
        DType::Plain(plain) => match converted(plain) {
            // The objects of a list may be rows.
            Ok(_) if plain.type_char() == TypeChar::Object && shape.len() == 1 => {
                (converted(plain), &[0, RAY_COLUMNS][..])
            }
            numbers => (numbers, shape),
        },
        // Their fields become the last dimension.
        DType::Record(_) if leaves(dtype) == Some(RAY_COLUMNS) => {
            let unstructured = "numpy.lib.recfunctions.structured_to_unstructured(rays, '<f8')";
            let rows: &[u64] = if shape.len() == 1 { &[0, RAY_COLUMNS] } else { &[0, 0, RAY_COLUMNS] };
            (Ok(unstructured.to_owned()), rows)
        }
        DType::Record(_) | DType::Array(..) => (Err("its rows are not 8 numbers"), shape),
    };
    let numbers = match numbers {
        Ok(numbers) => numbers,
        Err(reason) => return format!("{reason}; {ONE_ROW}"),
    };
    match shaped(&numbers, shape) {
        Some(rays) if shape.last() == Some(&RAY_COLUMNS) && shape.len() == 2 => format!("save `{rays}`"),
        Some(rays) => format!("save `{rays}`; {ONE_ROW}"),
        None => ONE_ROW.to_owned(),
    }
}

/// An expression for `rays` with numbers of a type that can be read, or why there is none.
fn converted(plain: &TypeStr) -> Result<String, &'static str> {
    Ok(match (plain.type_char(), plain.size_field()) {
        (TypeChar::Float, 4 | 8) if plain.to_string().starts_with('<') => "rays".to_owned(),
        // Whatever single precision holds.
        (TypeChar::Float | TypeChar::Int | TypeChar::Uint, 1 | 2) | (TypeChar::Float, 4) | (TypeChar::Bool, _) => {
            "rays.astype('<f4')".to_owned()
        }
        (TypeChar::Float | TypeChar::Int | TypeChar::Uint | TypeChar::ByteStr | TypeChar::UnicodeStr, _) => {
            "rays.astype('<f8')".to_owned()
        }
        (TypeChar::Object, _) => "np.array(rays.tolist(), '<f8')".to_owned(),
        (TypeChar::Complex, _) => return Err("complex numbers are no rays"),
        _ => return Err("its entries are no numbers"),
    })
}

/// Numbers in a record; `None` if it holds anything else.
fn leaves(dtype: &DType) -> Option<u64> {
    match dtype {
        DType::Plain(plain) => {
            matches!(plain.type_char(), TypeChar::Float | TypeChar::Int | TypeChar::Uint | TypeChar::Bool).then_some(1)
        }
        DType::Array(count, inner) => leaves(inner)?.checked_mul(*count),
        DType::Record(fields) => fields.iter().try_fold(0_u64, |sum, field| sum.checked_add(leaves(&field.dtype)?)),
    }
}

/// An expression for an array of this shape with one ray in each row; `None` where nothing says which numbers are a ray.
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
        format!("{:#}", Layout::of(&NpyHeader::from_reader(&file[..]).unwrap()).unwrap_err())
    }

    /// NumPy carries out each of these and gets the rays, none scrambled. Mutants: `reshape` for 8 × N, which scrambles them;
    /// a type that loses digits; types that are no numbers converted nevertheless.
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
