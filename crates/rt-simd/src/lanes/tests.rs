//! Every operation of every level against the same operation on plain numbers.

use super::*;
use crate::isa::{Found, Isa};
use rt_core::random;

/// Numbers of all sizes, zeros of both signs and infinities among them.
fn numbers(seed: u32) -> [f32; LANES] {
    core::array::from_fn(|i| {
        let [a, b] = random::pair(seed, i as u32, 0);
        match (b * 12.0) as u32 {
            0 => [0.0, -0.0, f32::INFINITY, f32::NEG_INFINITY][(a * 4.0) as usize],
            1 => f32::from_bits((a * 16_777_216.0) as u32 * 255),
            2 => [1.0, -1.0, 0.5][(a * 3.0) as usize],
            _ => 2.0 * a - 1.0,
        }
    })
}

fn check<L: Level>(level: L) {
    for seed in 0..200 {
        let [a, b, c] = [3 * seed, 3 * seed + 1, 3 * seed + 2].map(|seed| Lanes(numbers(seed)));
        sixteen(level, &a, &b, &c);
        eight(level, &a, &b, seed);
        for half in 0..2 {
            wide(level, a.half(half).map(f64::from), b.half(half).map(f64::from), seed as u8);
        }
        columns_and_rows(level, seed);
        sets(level, seed);
        parts(level, a, seed);
    }
}

fn bits(numbers: &[f32; LANES]) -> [u32; LANES] {
    numbers.map(f32::to_bits)
}

fn sixteen<L: Level>(level: L, a: &Lanes, b: &Lanes, c: &Lanes) {
    let (x, y, z) = (level.load(a), level.load(b), level.load(c));
    let stored = |word: L::F16| {
        let mut to = Lanes::ZERO;
        word.store(&mut to);
        to.0
    };
    let same = |word: L::F16, of: &dyn Fn(usize) -> f32, name: &str| {
        let want: [f32; LANES] = core::array::from_fn(of);
        let got = stored(word);
        // What a NaN looks like is nobody's business.
        let alike = got.iter().zip(&want).all(|(g, w)| g.to_bits() == w.to_bits() || g.is_nan() && w.is_nan());
        assert!(alike, "{name}: {got:?} {want:?}\n{a:?}\n{b:?}\n{c:?}");
    };
    let (a, b, c) = (&a.0, &b.0, &c.0);
    same(x, &|i| a[i], "load");
    same(level.splat(a[3]), &|_| a[3], "splat");
    same(x + y, &|i| a[i] + b[i], "add");
    same(x - y, &|i| a[i] - b[i], "sub");
    same(x * y, &|i| a[i] * b[i], "mul");
    same(x / y, &|i| a[i] / b[i], "div");
    same(x.lesser(y), &|i| if a[i] < b[i] { a[i] } else { b[i] }, "lesser");
    same(x.greater(y), &|i| if a[i] > b[i] { a[i] } else { b[i] }, "greater");
    same(x.abs(), &|i| a[i].abs(), "abs");
    same(x.abs().with_sign_of(y), &|i| a[i].abs().copysign(b[i]), "sign");
    same(x.power_below(), &|i| f32::from_bits(a[i].to_bits() & 0x7f80_0000), "power");
    for e in -125..126 {
        let power = |e: i32| f32::from_bits(((e + 127) as u32) << 23);
        same(level.splat(power(e)).reciprocal_of_power(), &|_| power(-e), "reciprocal");
    }
    let set = |of: &dyn Fn(usize) -> bool| (0..LANES).fold(0, |set, i| set | u16::from(of(i)) << i);
    assert_eq!(x.not_above(y), set(&|i| a[i] <= b[i]));
    assert_eq!(x.below(y), set(&|i| a[i] < b[i]));
    // Some of the quotients are NaN.
    assert_eq!((x / y).not_above(z), set(&|i| a[i] / b[i] <= c[i]));
    let some = (a[0].to_bits() ^ b[1].to_bits()) as u16;
    same(x.or_else(some, y), &|i| if some >> i & 1 == 1 { a[i] } else { b[i] }, "or else");
    same(x.groups_cab(), &|i| a[[8, 0, 4, 12][i / 4] + i % 4], "cab");
    same(x.groups_bca(), &|i| a[[4, 8, 0, 12][i / 4] + i % 4], "bca");
    same(level.load12(a), &|i| if i < 12 { a[i] } else { 0.0 }, "twelve");
    assert_eq!(x.least(), a.iter().copied().fold(a[0], f32::min));
    assert_eq!(x.greatest(), a.iter().copied().fold(a[0], f32::max));
    // Once or twice rounded.
    let either = |word: L::F16, once: &dyn Fn(usize) -> f32, twice: &dyn Fn(usize) -> f32| {
        for (i, got) in stored(word).into_iter().enumerate() {
            let alike = |want: f32| got.to_bits() == want.to_bits() || got.is_nan() && want.is_nan();
            assert!(alike(once(i)) || alike(twice(i)), "{got} {} {}", once(i), twice(i));
        }
    };
    either(x.mul_sub(y, z), &|i| libm::fmaf(a[i], b[i], -c[i]), &|i| a[i] * b[i] - c[i]);
    either(x.neg_mul_add(y, z), &|i| libm::fmaf(-a[i], b[i], c[i]), &|i| c[i] - a[i] * b[i]);
    for half in 0..2 {
        let mut eight = [0.0; 8];
        x.half(half).store(&mut eight);
        assert_eq!(eight.map(f32::to_bits), core::array::from_fn(|i| a[8 * half + i].to_bits()));
    }
}

fn eight<L: Level>(level: L, a: &Lanes, b: &Lanes, seed: u32) {
    let (x, y) = (level.load8(a.half(0)), level.load8(b.half(0)));
    let (a, b) = (a.half(0), b.half(0));
    let stored = |word: L::F8| {
        let mut to = [0.0; 8];
        word.store(&mut to);
        to
    };
    let alike = |word: L::F8, of: &dyn Fn(usize) -> f32| {
        for (i, got) in stored(word).into_iter().enumerate() {
            assert!(got.to_bits() == of(i).to_bits() || got.is_nan() && of(i).is_nan(), "{got} {}", of(i));
        }
    };
    alike(level.splat8(a[1]), &|_| a[1]);
    alike(x + y, &|i| a[i] + b[i]);
    alike(x - y, &|i| a[i] - b[i]);
    alike(x * y, &|i| a[i] * b[i]);
    alike(x / y, &|i| a[i] / b[i]);
    alike(x.lesser(y), &|i| if a[i] < b[i] { a[i] } else { b[i] });
    alike(x.greater(y), &|i| if a[i] > b[i] { a[i] } else { b[i] });
    alike(x.abs(), &|i| a[i].abs());
    alike(x.or_else(seed as u8, y), &|i| if seed >> i & 1 == 1 { a[i] } else { b[i] });
    let set = |of: &dyn Fn(usize) -> bool| (0..8).fold(0, |set, i| set | u8::from(of(i)) << i);
    assert_eq!(x.not_above(y), set(&|i| a[i] <= b[i]));
    assert_eq!(x.below(y), set(&|i| a[i] < b[i]));
    let word = a[seed as usize % 8];
    assert_eq!(x.same_bits(level.splat8(word)), set(&|i| a[i].to_bits() == word.to_bits()));
    let all = level.splat8(f32::from_bits(u32::MAX));
    assert_eq!(all.same_bits(all), u8::MAX);
    assert_eq!(x.lesser_bits(y), set(&|i| a[i].to_bits() < b[i].to_bits()));
    assert_eq!(x.lesser_bits(all), u8::MAX);
    assert_eq!(all.lesser_bits(x) | x.lesser_bits(x), 0);
    let mut wide = [0.0; 8];
    x.widen().store(&mut wide);
    assert_eq!(wide, a.map(f64::from));

    // A permutation of the slots, three bits each.
    let mut slots = [0_u32, 1, 2, 3, 4, 5, 6, 7];
    for i in (1..8).rev() {
        slots.swap(i as usize, random::below(i + 1, seed, i, 3) as usize);
    }
    let order = slots.iter().rev().fold(0, |order, slot| order << 3 | slot);
    let want: Vec<u32> = slots.into_iter().filter(|&slot| a[slot as usize] <= b[slot as usize]).collect();
    let (found, count) = x.not_above_in_order(y, order);
    let (mut numbers, mut words) = ([0; 8], [0; 8]);
    found.store(&mut numbers);
    found.pick(&core::array::from_fn(|i| 100 + i as u32), &mut words);
    assert_eq!(numbers[..count], want);
    assert!(words[..count].iter().zip(&want).all(|(word, slot)| *word == 100 + slot));
    let picked = stored(x.pick(found));
    assert!(picked[..count].iter().zip(&want).all(|(x, slot)| x.to_bits() == a[*slot as usize].to_bits()));
    assert!(numbers.iter().all(|&slot| slot < 8));
}

fn wide<L: Level>(level: L, a: [f64; 8], b: [f64; 8], some: u8) {
    let (x, y) = (level.load_wide(&a), level.load_wide(&b));
    let alike = |word: L::D8, of: &dyn Fn(usize) -> f64| {
        let mut to = [0.0; 8];
        word.store(&mut to);
        for (i, got) in to.into_iter().enumerate() {
            assert!(got.to_bits() == of(i).to_bits() || got.is_nan() && of(i).is_nan(), "{got} {}", of(i));
        }
    };
    alike(level.splat_wide(a[1]), &|_| a[1]);
    alike(x + y, &|i| a[i] + b[i]);
    alike(x - y, &|i| a[i] - b[i]);
    alike(x * y, &|i| a[i] * b[i]);
    alike(x / y, &|i| a[i] / b[i]);
    alike(x.lesser(y), &|i| if a[i] < b[i] { a[i] } else { b[i] });
    alike(x.greater(y), &|i| if a[i] > b[i] { a[i] } else { b[i] });
    alike(x.abs(), &|i| a[i].abs());
    alike(x.or_else(some, y), &|i| if some >> i & 1 == 1 { a[i] } else { b[i] });
    let set = |of: &dyn Fn(usize) -> bool| (0..8).fold(0, |set, i| set | u8::from(of(i)) << i);
    assert_eq!(x.not_above(y), set(&|i| a[i] <= b[i]));
    assert_eq!(x.below(y), set(&|i| a[i] < b[i]));
    let mut fused = [0.0; 8];
    x.mul_add(y, x).store(&mut fused);
    for (i, got) in fused.into_iter().enumerate() {
        let (once, twice) = (libm::fma(a[i], b[i], a[i]), a[i] * b[i] + a[i]);
        assert!([once, twice].iter().any(|x| x.to_bits() == got.to_bits() || x.is_nan() && got.is_nan()));
    }
    let mut narrow = [0.0; 8];
    (x * y).narrow().store(&mut narrow);
    for i in 0..8 {
        let want = (a[i] * b[i]) as f32;
        assert!(narrow[i].to_bits() == want.to_bits() || want.is_nan() && narrow[i].is_nan());
    }
}

/// A part has eight lanes of sixteen and a choice one of four numbers for each of them, whatever the bits mean.
fn parts<L: Level>(level: L, numbers: Lanes, seed: u32) {
    let set = (random::below(u16::MAX.into(), seed, 0, 4) >> (seed % 16)) as u16 + 1;
    let part = level.part(set);
    let members: Vec<usize> = (0..LANES).filter(|&i| part.set(part.members(set)) >> i & 1 == 1).collect();
    let few = part.set(part.members(set));
    assert!(few != 0 && few & !set == 0, "{set:b} {few:b}");
    if L::FEW_ALIKE > 0 {
        assert!(few >> set.trailing_zeros() & 1 == 1);
    }
    let places: Vec<usize> = (0..8).filter(|i| part.members(set) >> i & 1 == 1).collect();
    let mut wide = WideLanes::ZERO;
    wide.0.iter_mut().enumerate().for_each(|(i, x)| *x = f64::from(seed) + i as f64);
    let (mut narrow, mut doubles) = ([0.0; 8], [0.0; 8]);
    part.of(&numbers).store(&mut narrow);
    part.of_wide(&wide).store(&mut doubles);
    for (&lane, &place) in members.iter().zip(&places) {
        assert_eq!(narrow[place].to_bits(), numbers.0[lane].to_bits());
        assert_eq!(doubles[place], wide.0[lane]);
    }
    // Every second member is written, and nothing else.
    let some = places.iter().step_by(2).fold(0, |some, place| some | 1 << place);
    let (mut to, new) = (numbers, core::array::from_fn(|i| i as f32));
    part.put(some, level.load8(&new), &mut to);
    for (lane, got) in to.0.into_iter().enumerate() {
        let place = members.iter().position(|&member| member == lane).filter(|place| place % 2 == 0);
        assert_eq!(got.to_bits(), place.map_or(numbers.0[lane], |place| new[places[place]]).to_bits(), "{lane}");
        assert_eq!(part.set(some) >> lane & 1 == 1, place.is_some());
    }

    let (four, ids) = ([1.5_f32, -2.5, 3.5, f32::MIN_POSITIVE], [u32::MAX, 1, 0x7f80_0001, seed]);
    let alike = (seed & 3) as usize;
    let chosen = |numbers: L::D8, bits: L::F8, of: &dyn Fn(usize) -> usize| {
        let (mut doubles, mut words) = ([0.0; 8], [0.0; 8]);
        numbers.store(&mut doubles);
        bits.store(&mut words);
        for lane in 0..8 {
            assert_eq!(doubles[lane], f64::from(four[of(lane)]));
            assert_eq!(words[lane].to_bits(), ids[of(lane)]);
        }
    };
    let choice = Alike { level, choice: alike };
    chosen(choice.of(&four), choice.bits_of(ids), &|_| alike);
    let choice = level.choice(core::array::from_fn(|i| if i == alike { u8::MAX } else { 0 }));
    chosen(choice.of(&four), choice.bits_of(ids), &|_| alike);
    if L::FEW_ALIKE > 0 {
        let of = |lane: usize| random::below(4, seed, lane as u32, 5) as usize;
        let sets = core::array::from_fn(|i| (0..8).fold(0, |set, lane| set | u8::from(of(lane) == i) << lane));
        let choice = level.choice(sets);
        chosen(choice.of(&four), choice.bits_of(ids), &of);
    }
    for (half, upper) in [(Half::lower(level), 0), (Half::upper(level), 8)] {
        half.of(&numbers).store(&mut narrow);
        assert_eq!(narrow.map(f32::to_bits), core::array::from_fn(|i| numbers.0[upper + i].to_bits()));
        assert_eq!(u16::from(half.members(set)) << upper, set & 0xff << upper);
    }
}

fn columns_and_rows<L: Level>(level: L, seed: u32) {
    // Whatever the bits mean.
    let word = |row: usize, column: usize| f32::from_bits(seed.wrapping_mul(0x9e37_79b9) ^ (row << 8 | column) as u32);
    let table: [[f32; 8]; LANES] = core::array::from_fn(|row| core::array::from_fn(|column| word(row, column)));
    let columns = level.columns(&table);
    for (column, numbers) in columns.into_iter().enumerate() {
        let mut to = Lanes::ZERO;
        numbers.store(&mut to);
        assert_eq!(bits(&to.0), core::array::from_fn(|row| word(row, column).to_bits()));
    }
    let [a, b, c, d, ..] = columns;
    let mut rows = [[0.0; 4]; LANES];
    L::F16::store_rows([a, b, c, d], &mut rows);
    for (row, numbers) in rows.into_iter().enumerate() {
        assert_eq!(numbers.map(f32::to_bits), core::array::from_fn(|column| word(row, column).to_bits()), "{row}");
    }
}

fn sets<L: Level>(level: L, seed: u32) {
    let (mut sets, mut want) = (level.no_rays(), [0; 8]);
    for i in 0..4 {
        let (slots, ray) = (random::below(256, seed, i, 6) as u8, random::below(64, seed, i, 7));
        sets = sets.with(slots, 1 << ray);
        (0..8).for_each(|slot| want[slot] |= u64::from(slots >> slot & 1) << ray);
    }
    let mut got = [u64::MAX; 8];
    sets.store(&mut got);
    assert_eq!(got, want);
}

// Fails when two lanes of any operation are exchanged, or an operation rounds otherwise.
#[test]
fn every_level_computes_alike() {
    for isa in Isa::ALL {
        match Found::look_for(isa) {
            Some(Found::Portable(level)) => check(level),
            #[cfg(target_arch = "x86_64")]
            Some(Found::Avx2(level)) => check(level),
            #[cfg(target_arch = "x86_64")]
            Some(Found::Avx512(level)) => check(level),
            None => eprintln!("{isa}: this processor lacks it"),
        }
    }
}
