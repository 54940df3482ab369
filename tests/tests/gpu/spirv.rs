//! What drivers may make of a kernel: SPIR-V in which sums of products are fused, or denormal results are flushed.

use libtest_mimic::Failed;
use std::collections::HashMap;
use std::fs;
use std::path::PathBuf;
use std::process::Command;

/// Which products are fused with the sum or difference that they are an operand of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Pattern {
    /// Only products that are the left operand.
    Left,
    /// Only products that are the right operand.
    Right,
    /// Both; of two products that are added, the left one.
    Both,
    /// As [`Pattern::Both`], but about every other sum is left as it is.
    Scattered,
}

impl Pattern {
    pub(crate) const ALL: [Self; 4] = [Self::Left, Self::Right, Self::Both, Self::Scattered];

    /// Whether the sum with this id is left as it is.
    const fn leaves(self, id: u32) -> bool {
        // Multiplicative hashing (Knuth, The Art of Computer Programming, volume 3): the upper bit depends on all
        // others.
        matches!(self, Self::Scattered) && id.wrapping_mul(0x9e37_79b9) >> 31 == 0
    }
}

const HEADER: usize = 5;

// Opcodes and numbers of the SPIR-V specification.
const EXT_INST_IMPORT: u32 = 11;
const EXT_INST: u32 = 12;
const CAPABILITY: u32 = 17;
const TYPE_INT: u32 = 21;
const TYPE_FLOAT: u32 = 22;
const TYPE_VECTOR: u32 = 23;
const CONSTANT: u32 = 43;
const FUNCTION: u32 = 54;
const DECORATE: u32 = 71;
const COMPOSITE_CONSTRUCT: u32 = 80;
const F_CONVERT: u32 = 115;
const BITCAST: u32 = 124;
const F_NEGATE: u32 = 127;
const F_ADD: u32 = 129;
const F_SUB: u32 = 131;
const I_MUL: u32 = 132;
const F_MUL: u32 = 133;
const F_DIV: u32 = 136;
const VECTOR_TIMES_SCALAR: u32 = 142;
const SHIFT_RIGHT_LOGICAL: u32 = 194;
const BITWISE_AND: u32 = 199;
const NO_CONTRACTION: u32 = 42;
const FLOAT64: u32 = 10;
/// Of GLSL.std.450, the only set that naga imports.
const FMA: u32 = 50;
const U_MIN: u32 = 38;

/// A product of two values, perhaps negated.
#[derive(Clone, Copy)]
struct Product {
    negative: bool,
    a: u32,
    b: u32,
    /// Whether `b` is one number for all components of `a`.
    scalar: bool,
}

/// Instructions being written, and the next free id.
struct Writer {
    words: Vec<u32>,
    next: u32,
}

impl Writer {
    fn put(&mut self, op: u32, operands: &[u32]) {
        self.words.push((operands.len() as u32 + 1) << 16 | op);
        self.words.extend(operands);
    }

    /// An instruction with a result of type `ty`.
    fn value(&mut self, op: u32, ty: u32, operands: &[u32]) -> u32 {
        let id = self.next;
        self.next += 1;
        self.put(op, &[&[ty, id], operands].concat());
        id
    }
}

/// The kernel in one function without variables, as drivers see it before they contract.
pub(crate) fn flattened(words: &[u32], name: &str) -> Result<Vec<u32>, Failed> {
    let file = |what: &str| PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}.{what}.spv"));
    let (from, to) = (file("in"), file("out"));
    fs::write(&from, words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>())?;
    let done = Command::new("spirv-opt").arg("-O").arg(&from).arg("-o").arg(&to).output()?;
    if !done.status.success() {
        return Err(format!("spirv-opt: {}", String::from_utf8_lossy(&done.stderr)).into());
    }
    let bytes = fs::read(&to)?;
    Ok(bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect())
}

/// A sum to be fused: `product ± addend`.
#[derive(Clone, Copy)]
struct Fusion {
    product: Product,
    addend: u32,
    minus: bool,
}

/// The module with products and sums fused, and how many. What else is decorated stays so: drivers change nothing more.
///
/// Fused by double precision: the product is exact there. The sum is rounded twice, which a fused operation would not
/// do; it is as wrong for the kernels as that.
pub(crate) fn fused(words: &[u32], pattern: Pattern) -> (Vec<u32>, usize) {
    let floats = numbers(words, TYPE_FLOAT);
    let fusions = fusions(words, pattern, &products(words, &floats));
    let mut out = Writer { words: words[..HEADER].to_vec(), next: words[3] };
    out.put(CAPABILITY, &[FLOAT64]);
    let mut doubles = HashMap::new();
    for instruction in split(words) {
        match (instruction[0] & 0xffff, instruction) {
            (DECORATE, [_, id, NO_CONTRACTION]) if fusions.contains_key(id) => continue,
            (FUNCTION, _) if doubles.is_empty() => doubles = declare_doubles(&mut out, &floats),
            _ => {}
        }
        match instruction {
            [_, ty, id, ..] if fusions.contains_key(id) && floats.contains_key(ty) => {
                fuse(&mut out, [*ty, *id], doubles[ty], floats[ty], fusions[id]);
            }
            _ => out.words.extend(instruction),
        }
    }
    out.words[3] = out.next;
    (out.words, fusions.len())
}

/// What is fused, by the id of its result: sums with a product where the pattern wants one, and what was fused before.
fn fusions(words: &[u32], pattern: Pattern, products: &HashMap<u32, Product>) -> HashMap<u32, Fusion> {
    let mut fusions = HashMap::new();
    for instruction in split(words) {
        match *instruction {
            [first, _, id, left, right] if [F_ADD, F_SUB].contains(&(first & 0xffff)) && !pattern.leaves(id) => {
                let minus = first & 0xffff == F_SUB;
                let of = |operand, wanted: bool| products.get(&operand).filter(|_| wanted);
                let fusion = match (of(left, pattern != Pattern::Right), of(right, pattern != Pattern::Left)) {
                    (Some(&product), _) => Fusion { product, addend: right, minus },
                    (None, Some(&product)) => {
                        let product = Product { negative: product.negative != minus, ..product };
                        Fusion { product, addend: left, minus: false }
                    }
                    (None, None) => continue,
                };
                fusions.insert(id, fusion);
            }
            // By spirv-opt, where nothing forbids it.
            [first, _, id, _, FMA, a, b, addend] if first & 0xffff == EXT_INST => {
                let product = Product { negative: false, a, b, scalar: false };
                fusions.insert(id, Fusion { product, addend, minus: false });
            }
            _ => {}
        }
    }
    fusions
}

/// Writes `[ty, id] = ± a b ± addend`, rounded once.
fn fuse(out: &mut Writer, [ty, id]: [u32; 2], double: u32, components: usize, fusion: Fusion) {
    let Fusion { product, addend, minus } = fusion;
    let b = match product.scalar {
        true => out.value(COMPOSITE_CONSTRUCT, ty, &vec![product.b; components]),
        false => product.b,
    };
    let [a, b, c] = [product.a, b, addend].map(|value| out.value(F_CONVERT, double, &[value]));
    let a = if product.negative { out.value(F_NEGATE, double, &[a]) } else { a };
    let exact = out.value(F_MUL, double, &[a, b]);
    let sum = out.value(if minus { F_SUB } else { F_ADD }, double, &[exact, c]);
    out.put(F_CONVERT, &[ty, id, sum]);
}

/// The module with every denormal result of arithmetic replaced by 0.
pub(crate) fn flushed(words: &[u32]) -> Vec<u32> {
    let floats = numbers(words, TYPE_FLOAT);
    let mut out = Writer { words: words[..HEADER].to_vec(), next: words[3] };
    let is_arithmetic = |op| [F_ADD, F_SUB, F_MUL, F_DIV, VECTOR_TIMES_SCALAR].contains(&op);
    // What results are called before they are flushed.
    let mut raw = HashMap::new();
    let mut library = 0;
    for instruction in split(words) {
        match (instruction[0] & 0xffff, instruction) {
            (EXT_INST_IMPORT, [_, id, ..]) => library = *id,
            (op, [_, _, id, ..]) if is_arithmetic(op) => {
                raw.insert(*id, out.next);
                out.next += 1;
            }
            _ => {}
        }
    }
    let mut constants = None;
    for instruction in split(words) {
        if instruction[0] & 0xffff == FUNCTION && constants.is_none() {
            constants = Some(BitConstants::declare(&mut out, words, &floats));
        }
        match (instruction, &constants) {
            ([first, id, NO_CONTRACTION], _) if first & 0xffff == DECORATE => {
                out.put(DECORATE, &[raw.get(id).copied().unwrap_or(*id), NO_CONTRACTION]);
            }
            ([first, ty, id, operands @ ..], Some(constants)) if is_arithmetic(first & 0xffff) => {
                out.put(first & 0xffff, &[&[*ty, raw[id]], operands].concat());
                constants.flush(&mut out, [*ty, *id], raw[id], floats[ty], library);
            }
            _ => out.words.extend(instruction),
        }
    }
    out.words[3] = out.next;
    out.words
}

/// What it takes to look at a number's exponent.
struct BitConstants {
    /// Whole numbers, by number of components.
    types: HashMap<usize, u32>,
    /// 23, 255 and 1.
    values: [u32; 3],
}

impl BitConstants {
    /// Writes constants, and those types that are not there yet.
    fn declare(out: &mut Writer, words: &[u32], floats: &HashMap<u32, usize>) -> Self {
        let there = numbers(words, TYPE_INT);
        let mut types: HashMap<usize, u32> = there.iter().map(|(&id, &size)| (size, id)).collect();
        let scalar = types[&1];
        for &size in floats.values() {
            types.entry(size).or_insert_with(|| {
                let id = out.next;
                out.next += 1;
                out.put(TYPE_VECTOR, &[id, scalar, size as u32]);
                id
            });
        }
        Self { types, values: [23, 255, 1].map(|value| out.value(CONSTANT, scalar, &[value])) }
    }

    /// Writes `[ty, id] = x`, or 0 where the exponent's bits are 0.
    fn flush(&self, out: &mut Writer, [ty, id]: [u32; 2], x: u32, components: usize, library: u32) {
        let whole = self.types[&components];
        let [shift, mask, one] = match components {
            1 => self.values,
            _ => self.values.map(|value| out.value(COMPOSITE_CONSTRUCT, whole, &vec![value; components])),
        };
        let bits = out.value(BITCAST, whole, &[x]);
        let shifted = out.value(SHIFT_RIGHT_LOGICAL, whole, &[bits, shift]);
        let exponent = out.value(BITWISE_AND, whole, &[shifted, mask]);
        let normal = out.value(EXT_INST, whole, &[library, U_MIN, exponent, one]);
        let kept = out.value(I_MUL, whole, &[bits, normal]);
        out.put(BITCAST, &[ty, id, kept]);
    }
}

/// Types of 32-bit numbers of a kind, unsigned if whole, and of vectors of them, with their numbers of components.
fn numbers(words: &[u32], kind: u32) -> HashMap<u32, usize> {
    let mut found = HashMap::new();
    for instruction in split(words) {
        match *instruction {
            [first, id, 32] | [first, id, 32, 0] if first & 0xffff == kind => {
                found.insert(id, 1);
            }
            [first, id, component, count] if first & 0xffff == TYPE_VECTOR && found.get(&component) == Some(&1) => {
                found.insert(id, count as usize);
            }
            _ => {}
        }
    }
    found
}

/// Every product by the id of its result, also seen through negations.
fn products(words: &[u32], floats: &HashMap<u32, usize>) -> HashMap<u32, Product> {
    let mut products: HashMap<u32, Product> = HashMap::new();
    for instruction in split(words) {
        match (instruction[0] & 0xffff, instruction) {
            (F_MUL, [_, ty, id, a, b]) if floats.contains_key(ty) => {
                products.insert(*id, Product { negative: false, a: *a, b: *b, scalar: false });
            }
            (VECTOR_TIMES_SCALAR, [_, _, id, a, b]) => {
                products.insert(*id, Product { negative: false, a: *a, b: *b, scalar: true });
            }
            (F_NEGATE, [_, _, id, of]) => {
                if let Some(&product) = products.get(of) {
                    products.insert(*id, Product { negative: !product.negative, ..product });
                }
            }
            _ => {}
        }
    }
    products
}

/// The type in double precision for each in single precision.
fn declare_doubles(out: &mut Writer, floats: &HashMap<u32, usize>) -> HashMap<u32, u32> {
    let mut of_size = HashMap::new();
    let scalar = out.next;
    out.next += 1;
    out.put(TYPE_FLOAT, &[scalar, 64]);
    of_size.insert(1, scalar);
    let mut doubles = HashMap::new();
    for (&single, &size) in floats {
        let double = *of_size.entry(size).or_insert_with(|| {
            let id = out.next;
            out.next += 1;
            out.put(TYPE_VECTOR, &[id, scalar, size as u32]);
            id
        });
        doubles.insert(single, double);
    }
    doubles
}

fn split(words: &[u32]) -> impl Iterator<Item = &[u32]> {
    let mut rest = words.get(HEADER..).unwrap_or_default();
    std::iter::from_fn(move || {
        let length = (rest.first()? >> 16) as usize;
        let (instruction, later) = rest.split_at_checked(length.max(1))?;
        rest = later;
        Some(instruction)
    })
}
