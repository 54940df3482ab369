//! A pass over finished SPIR-V, for what naga cannot say.
//!
//! * Every arithmetic instruction on floating-point numbers is decorated `NoContraction`: else drivers may fuse or
//!   reorder them, and double-float arithmetic and error bounds would fail.
//! * Arrays in functions lose the initialiser that WGSL asks for: filling a stack with zeros for each ray costs more
//!   than using it.

use std::collections::HashSet;

const HEADER: usize = 5;

// Opcodes and numbers of the SPIR-V specification.
const OP_TYPE_ARRAY: u32 = 28;
const OP_TYPE_POINTER: u32 = 32;
const OP_FUNCTION: u32 = 54;
const OP_VARIABLE: u32 = 59;
const OP_DECORATE: u32 = 71;
/// The section of annotations ends where types begin; the lowest opcode of a type.
const OP_TYPES: std::ops::RangeInclusive<u32> = 19..=39;
/// FNegate is exact, but contraction may look through it.
const OP_ARITHMETIC: &[u32] = &[
    127, // FNegate
    129, // FAdd
    131, // FSub
    133, // FMul
    136, // FDiv
    142, // VectorTimesScalar
];
const DECORATION_NO_CONTRACTION: u32 = 42;

/// The module with the changes made; an error when it is malformed.
pub(crate) fn mend(words: &[u32]) -> Result<Vec<u32>, String> {
    let instructions = split(words)?;
    let mut arrays = HashSet::new();
    let mut array_pointers = HashSet::new();
    let mut decorations = Vec::new();
    for instruction in &instructions {
        match (instruction[0] & 0xffff, *instruction) {
            (OP_TYPE_ARRAY, [_, id, ..]) => {
                arrays.insert(*id);
            }
            (OP_TYPE_POINTER, [_, id, _, pointee]) if arrays.contains(pointee) => {
                array_pointers.insert(*id);
            }
            (op, [_, _, id, ..]) if OP_ARITHMETIC.contains(&op) => {
                decorations.extend([3 << 16 | OP_DECORATE, *id, DECORATION_NO_CONTRACTION]);
            }
            _ => {}
        }
    }
    let mut out = words[..HEADER].to_vec();
    let mut in_function = false;
    let mut decorated = false;
    for instruction in instructions {
        let op = instruction[0] & 0xffff;
        if !decorated && OP_TYPES.contains(&op) {
            out.extend(&decorations);
            decorated = true;
        }
        in_function |= op == OP_FUNCTION;
        match instruction {
            [_, pointer, id, class, _] if op == OP_VARIABLE && in_function && array_pointers.contains(pointer) => {
                out.extend([4 << 16 | OP_VARIABLE, *pointer, *id, *class]);
            }
            _ => out.extend(instruction),
        }
    }
    Ok(out)
}

fn split(words: &[u32]) -> Result<Vec<&[u32]>, String> {
    let mut rest = words.get(HEADER..).ok_or("no header")?;
    let mut instructions = Vec::new();
    while let Some(first) = rest.first() {
        let length = (first >> 16) as usize;
        if length == 0 || length > rest.len() {
            return Err(format!("an instruction of {length} words with {} left", rest.len()));
        }
        let (instruction, later) = rest.split_at(length);
        instructions.push(instruction);
        rest = later;
    }
    Ok(instructions)
}
