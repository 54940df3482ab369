use super::*;
use glam::Vec3;

/// A file as `np.save` writes it: version 1.0, header padded to 64 bytes.
fn npy(dict: &str, data: &[u8]) -> Vec<u8> {
    let length = (10 + dict.len() + 1).next_multiple_of(64) - 10;
    let mut file = b"\x93NUMPY\x01\x00".to_vec();
    file.extend((length as u16).to_le_bytes());
    file.extend(format!("{dict:<width$}\n", width = length - 1).bytes());
    file.extend(data);
    file
}

fn dict(descr: &str, fortran: &str, shape: &str) -> String {
    format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}")
}

fn bytes_of(rays: &[Ray]) -> &[u8] {
    bytemuck::cast_slice(rays)
}

fn some_rays(count: usize) -> Vec<Ray> {
    (0..count).map(|i| Ray::new(Vec3::splat(i as f32), Vec3::Z).with_range(0.5, f32::INFINITY)).collect()
}

fn parse_rays(file: &[u8], offset: DVec3) -> Result<Vec<Ray>, RayFileError> {
    RayFile::new(file, "rays.npy".to_owned())?.read(offset)
}

fn refusal(file: &[u8]) -> String {
    let message = parse_rays(file, DVec3::ZERO).expect_err("must be refused").to_string();
    assert!(message.contains("rays.npy"), "{message}");
    message
}

#[test]
fn rays_keep_every_bit() {
    // Across the chunk size; with a signalling NaN, which a float conversion would turn into a quiet one.
    let mut rays = some_rays(CHUNK + 3);
    rays[7].tmin = f32::from_bits(0x7f80_0001);
    let shape = format!("({}, 8)", rays.len());
    let read = parse_rays(&npy(&dict("<f4", "False", &shape), bytes_of(&rays)), DVec3::ZERO).unwrap();
    assert_eq!(bytes_of(&read), bytes_of(&rays));
    assert!(parse_rays(&npy(&dict("<f4", "False", "(0, 8)"), &[]), DVec3::ZERO).unwrap().is_empty());
}

/// Fails when origins are rounded before the offset is subtracted.
#[test]
fn origins_in_double_precision_keep_their_digits_relative_to_the_offset() {
    let offset = DVec3::new(500_000.0, 5_412_345.312_5, 0.0);
    let rows: Vec<[f64; 8]> = (0..CHUNK + 3)
        .map(|i| [500_000.05, 5_412_345.25 + i as f64 * 1e-5, 200.0, 0.125, 0.0, 0.0, -1.0, f64::INFINITY])
        .collect();
    let file = npy(&dict("<f8", "False", &format!("({}, 8)", rows.len())), bytemuck::cast_slice(&rows));
    let rays = parse_rays(&file, offset).unwrap();
    assert_eq!(rays.len(), rows.len());
    for (ray, row) in rays.iter().zip(&rows) {
        let wanted = DVec3::new(row[0], row[1], row[2]);
        assert!((ray.origin.as_dvec3() + offset - wanted).abs().max_element() < 1e-8, "{ray:?} for {wanted}");
        assert_eq!((ray.tmin, ray.direction, ray.tmax), (0.125, Vec3::NEG_Z, f32::INFINITY));
    }
    // Those in single precision are in the same coordinates.
    let ray = [Ray::new(Vec3::new(500_000.0, 5_412_345.5, 1.0), Vec3::Z)];
    let read = parse_rays(&npy(&dict("<f4", "False", "(1, 8)"), bytes_of(&ray)), offset).unwrap();
    assert_eq!(read[0].origin, Vec3::new(0.0, 0.187_5, 1.0));
    assert!(refusal(&file[..file.len() - 1]).contains("promises"));
}

/// Mutant: rows and columns exchanged, in which NumPy's `rays.T` of an 8 × N array is saved.
#[test]
fn rays_by_columns_are_the_same_rays() {
    for rows in [0, 1, 3, CHUNK + 3, 2 * CHUNK * COLUMNS + 5] {
        let rays: Vec<Ray> =
            (0..rows).map(|i| Ray::new(Vec3::new(i as f32, 1.0, 2.0), Vec3::Z).with_range(0.5, i as f32)).collect();
        let words: &[[u32; COLUMNS]] = bytemuck::cast_slice(&rays);
        let by_columns: Vec<u32> = (0..COLUMNS).flat_map(|c| words.iter().map(move |row| row[c])).collect();
        let file = npy(&dict("<f4", "True", &format!("({rows}, 8)")), bytemuck::cast_slice(&by_columns));
        assert_eq!(bytes_of(&parse_rays(&file, DVec3::ZERO).unwrap()), bytes_of(&rays));
        let doubles: Vec<f64> = by_columns.iter().map(|&bits| f64::from(f32::from_bits(bits))).collect();
        let file = npy(&dict("<f8", "True", &format!("({rows}, 8)")), bytemuck::cast_slice(&doubles));
        let offset = DVec3::new(1.0, 0.0, 2.0);
        let moved = rays.iter().map(|ray| (ray.origin.as_dvec3() - offset).as_vec3());
        assert!(parse_rays(&file, offset).unwrap().iter().map(|ray| ray.origin).eq(moved));
        if rows > 0 {
            assert!(refusal(&file[..file.len() - 1]).contains("promises"));
        }
    }
}

#[test]
fn what_is_no_array_of_rays_is_refused() {
    assert!(refusal(b"o cube\nv 0 0 0\n").contains("np.save"));
    assert!(refusal(b"PK\x03\x04 an archive").contains(".npz"));
    assert!(refusal(&npy(&dict("<f4", "False", "(5000000000, 8)"), &[])).contains("split the file"));
    assert!(refusal(&npy(&dict("<f4", "False", "(8, 7)"), &[0; 224])).contains("save `rays.T`"));
}

#[test]
fn a_file_that_ends_early_is_refused() {
    let rays = some_rays(CHUNK + 3);
    let file = npy(&dict("<f4", "False", &format!("({}, 8)", rays.len())), bytes_of(&rays));
    for length in [0, 5, 9, 40, 128, 1000, file.len() - 1] {
        refusal(&file[..length]);
    }
    // A promise of 128 GiB must not be believed before the data are there.
    assert!(refusal(&npy(&dict("<f4", "False", "(4294967295, 8)"), &[0; 64])).contains("4294967295"));
}

/// Fails when brackets may be nested however deep, or a shape's sides are multiplied without a look.
#[test]
fn hostile_headers_are_refused() {
    refusal(&npy(&format!("{}{}", "[".repeat(4_900), "]".repeat(4_900)), &[]));
    refusal(&npy(&dict("<f4", "False", "(4294967296, 4294967296, 4294967296)"), &[]));
    refusal(&npy(&dict("<f4", "False", "(0xffffffffffff, 0xffffffffffff)"), &[]));
    let mut long = npy(&dict("<f4", "False", "(1, 8)"), &[0; 32]);
    long[6] = 2;
    long[8..12].fill(0xff);
    assert!(refusal(&long).contains("damaged"));
}

#[test]
fn garbage_is_refused_or_read_but_never_panics() {
    let file = npy(&dict("<f4", "False", "(3, 8)"), bytes_of(&some_rays(3)));
    let mut state = 1_u32;
    let mut next = || {
        // Xorshift: G. Marsaglia, Xorshift RNGs, Journal of Statistical Software 8-14 (2003).
        state ^= state << 13;
        state ^= state >> 17;
        state ^= state << 5;
        state
    };
    let alphabet = b"()[]{}'\",:-0123456789TF\\x \xff";
    for _ in 0..20_000 {
        let mut broken = file.clone();
        for _ in 0..next() % 4 + 1 {
            let place = next() as usize % broken.len();
            broken[place] = alphabet[next() as usize % alphabet.len()];
        }
        let _ = parse_rays(&broken, DVec3::ZERO);
    }
}

/// Fails when a header is believed that promises more rays than its file has room for.
#[test]
fn there_are_no_more_rays_than_the_file_has_room_for() {
    let file = tempfile::NamedTempFile::new().unwrap();
    let header = |descr| dict(descr, "False", "(1000000000, 8)");
    for (descr, row) in [("<f4", 32), ("<f8", 64)] {
        let bytes = npy(&header(descr), &[0; 320]);
        std::fs::write(file.path(), &bytes).unwrap();
        let most = RayFile::open(file.path()).unwrap().most_rays();
        assert_eq!(most, bytes.len() as u64 / row);
        // Memory and pipes may hold whatever the header says.
        assert_eq!(RayFile::new(&*bytes, String::new()).unwrap().most_rays(), 1_000_000_000);
    }
}
