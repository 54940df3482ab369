//! Pictures: what they depend on, and those that do not fit.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

fn render(out: &Path, arguments: &[&str]) -> Output {
    let run =
        Command::new(env!("CARGO_BIN_EXE_raybalance")).arg("render").args(arguments).arg("--out").arg(out).output();
    run.expect("the program starts")
}

fn rendered(arguments: &[&str]) -> Vec<u8> {
    let dir = tempfile::tempdir().expect("a folder");
    let run = render(dir.path(), arguments);
    assert!(run.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&run.stderr));
    fs::read(dir.path().join("image.png")).expect("a picture")
}

/// Fails when noise depends on waves, a bounce numbers its rays anew in each of them, or sums depend on who traced
/// what.
#[test]
fn a_picture_depends_on_its_seed_alone() {
    let common = ["yard", "--size", "61x40", "--spp", "3", "--bounces", "2", "--seed", "5"];
    let with = |more: &[&str]| rendered(&[&common, more].concat());
    let picture = with(&["--devices", "cpu:1", "--memory", "4G"]);
    for other in [
        &["--devices", "cpu:1", "--memory", "1M"][..],
        &["--devices", "cpu:1", "--memory", "1500K", "--task-size", "64"],
        &["--devices", "cpu:1,cpu:1", "--queue", "static", "--tasks", "7"],
        &["--devices", "cpu:2", "--memory", "1M", "--estimator", "exact", "--queue", "central"],
        // In one go instead of in passes.
        &["--devices", "cpu:1", "--reference"],
    ] {
        assert!(with(other) == picture, "another picture with {other:?}");
    }
    let seed = common.map(|word| if word == "5" { "6" } else { word });
    assert!(rendered(&[&seed[..], &["--devices", "cpu:1"]].concat()) != picture, "the seed changes nothing");
}

/// Fails when radiance depends on who traced what, is exposed as the picture is, or a frame counts as whole whose file
/// of radiance is not there.
#[cfg(feature = "exr")]
#[test]
fn radiance_and_costs_are_there_as_numbers() {
    use exr::prelude::{Vec2, read_all_flat_layers_from_file, read_first_rgba_layer_from_file};
    let dir = tempfile::tempdir().expect("a folder");
    let common = ["yard", "--size", "61x40", "--spp", "2", "--exr"];
    let radiance = |out: &str, more: &[&str]| {
        let out = dir.path().join(out);
        let run = render(&out, &[&common, more].concat());
        assert!(run.status.success(), "{more:?}: {}", String::from_utf8_lossy(&run.stderr));
        let read = read_first_rgba_layer_from_file(
            out.join("image.exr"),
            // Blocks of rows are unpacked on several threads and come in any order.
            |size, _| (size, vec![[f32::NAN; 3]; size.area()]),
            |(size, pixels): &mut (Vec2<usize>, Vec<[f32; 3]>), at, (r, g, b, _): (f32, f32, f32, f32)| {
                pixels[at.flat_index_for_size(*size)] = [r, g, b];
            },
        );
        read.expect("radiance").layer_data.channel_data.pixels
    };
    let (size, pixels) = radiance("one", &["--devices", "cpu:1"]);
    assert_eq!(((size.0, size.1), pixels.len()), ((61, 40), 61 * 40));
    assert!(pixels.as_flattened().iter().all(|radiance| radiance.is_finite() && *radiance >= 0.0));
    // The sun and the sky of these scenes are far brighter than white.
    let brightest = pixels.as_flattened().iter().copied().fold(0.0, f32::max);
    assert!(brightest > 1.5, "{brightest}");
    let other = radiance("two", &["--devices", "cpu:1,cpu:1", "--task-size", "64", "--memory", "1M"]);
    assert!((size, pixels) == other, "other radiance on other devices");

    let costs = read_all_flat_layers_from_file(dir.path().join("one/cost.exr")).expect("costs");
    let channels = &costs.layer_data[0].channel_data.list;
    let named = |name: &str| channels.iter().find(|channel| channel.name.to_string() == name);
    let measured: Vec<f32> = named("primary.measured_ns").expect("a channel").sample_data.values_as_f32().collect();
    assert!(measured.len() == 61 * 40 && measured.iter().all(|ns| *ns > 0.0), "each pixel has a primary ray");
    assert!(named("shadow_0.measured_ns").is_some());

    let out = dir.path().join("frames");
    let frames = |more: &[&str]| render(&out, &[&common[..5], &["--frames", "2", "--devices", "cpu:1"], more].concat());
    assert!(frames(&[]).status.success());
    let exr = out.join("image-0001.exr");
    assert!(!exr.exists());
    assert!(frames(&["--exr"]).status.success() && exr.exists());
    let again = frames(&["--exr"]);
    assert!(String::from_utf8_lossy(&again.stderr).contains("2 of 2 frames are whole"), "{again:?}");
}

/// A picture that is to be there in no time has its first pass, and says so.
///
/// Fails when the time is not looked at, or a picture of one sample is divided by those that were asked for.
#[test]
fn a_time_limit_ends_with_the_pass_that_fits() {
    let dir = tempfile::tempdir().expect("a folder");
    let run = render(dir.path(), &["yard", "--size", "64x40", "--spp", "64", "--devices", "cpu:1", "--time", "0.001"]);
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let text = String::from_utf8_lossy(&run.stdout).into_owned();
    assert!(text.contains("1 of 64 samples of each pixel"), "{text}");
    let report = fs::read(dir.path().join("report.json")).expect("a report");
    let report: serde_json::Value = serde_json::from_slice(&report).expect("JSON");
    let picture = &report["picture"];
    assert_eq!((picture["samples"].as_u64(), picture["samples_asked"].as_u64()), (Some(1), Some(64)), "{picture}");
    // It is as bright as one of all samples.
    let mean = |path: &Path| {
        let file = std::io::BufReader::new(fs::File::open(path).expect("a picture"));
        let mut reader = png::Decoder::new(file).read_info().expect("a picture");
        let mut bytes = vec![0; reader.output_buffer_size().expect("a size")];
        reader.next_frame(&mut bytes).expect("its pixels");
        bytes.iter().map(|&byte| f64::from(byte)).sum::<f64>() / bytes.len() as f64
    };
    let early = mean(&dir.path().join("image.png"));
    assert!(render(dir.path(), &["yard", "--size", "64x40", "--spp", "4", "--devices", "cpu:1"]).status.success());
    let whole = mean(&dir.path().join("image.png"));
    assert!((early / whole - 1.0).abs() < 0.1, "{early} {whole}");
}

/// What no machine has room for is refused at once, with what it needs and what there is.
#[test]
fn pictures_beyond_the_memory_are_refused_with_both_numbers() {
    let dir = tempfile::tempdir().expect("a folder");
    let size = ["yard", "--size", "65536x65536", "--spp", "4096", "--task-size", "1", "--devices", "cpu:1"];
    let run = render(dir.path(), &size);
    let error = String::from_utf8_lossy(&run.stderr).into_owned();
    assert_eq!(run.status.code(), Some(1), "{error}");
    for part in ["65536 x 65536 pixels", "12 bytes a pixel", "needs about", "GB", "choose a smaller --size"] {
        assert!(error.contains(part), "{part}: {error}");
    }
}

/// Fails when the limit of the address space is not looked at, or a large vector is asked for without a way to fail.
#[cfg(target_os = "linux")]
#[test]
fn a_limited_address_space_ends_in_an_error() {
    let dir = tempfile::tempdir().expect("a folder");
    let limited = |kilobytes: u64, size: &str| {
        let program = env!("CARGO_BIN_EXE_raybalance");
        let out = dir.path().display();
        let line = format!(
            "ulimit -v {kilobytes}; exec {program} render yard --size {size} --spp 1 --bounces 0 --devices cpu:1 --memory 64M --out {out}"
        );
        let run = Command::new("sh").arg("-c").arg(line).output().expect("a shell");
        (run.status.code(), String::from_utf8_lossy(&run.stderr).into_owned())
    };
    let (code, error) = limited(8_000_000, "40000x40000");
    assert_eq!(code, Some(1), "{error}");
    assert!(
        error.contains("needs about") && error.contains("12 bytes a pixel") && error.contains("ulimit -v"),
        "{error}"
    );
    let (code, error) = limited(8_000_000, "64x40");
    assert_eq!(code, Some(0), "{error}");
}

/// Rays of a file and of measured streams, too, are refused before they are read or made. Fails when a command does not
/// ask.
#[cfg(target_os = "linux")]
#[test]
fn streams_beyond_the_memory_are_refused_with_both_numbers() {
    let dir = tempfile::tempdir().expect("a folder");
    let rays = dir.path().join("rays.npy");
    // A file with a hole: it takes no disk.
    let header = format!("{:<117}\n", "{'descr': '<f4', 'fortran_order': False, 'shape': (134217728, 8), }");
    fs::write(&rays, [&b"\x93NUMPY\x01\x00\x76\x00"[..], header.as_bytes()].concat()).expect("a file");
    let file = fs::OpenOptions::new().write(true).open(&rays).expect("the file");
    file.set_len(128 + (32 << 27)).expect("a file with a hole");
    let [rays, out] = [rays, dir.path().join("out")].map(|path| path.display().to_string());
    for (command, advice) in [
        (format!("trace yard --rays {rays} --hits {out}"), "split the file"),
        (format!("figure1 yard --size 65536x65536 --out {out}"), "choose a smaller --size"),
        (format!("tradeoff build yard --size 65536x65536 --out {out}"), "choose a smaller --size"),
        (format!("tradeoff precision yard --size 65536x65536 --out {out}"), "choose a smaller --size"),
        (format!("bench yard --devices cpu:1 --rays 268435456 --out {out}"), "choose fewer --rays"),
    ] {
        let line = format!("ulimit -v 8000000; exec {} {command}", env!("CARGO_BIN_EXE_raybalance"));
        let run = Command::new("sh").arg("-c").arg(line).output().expect("a shell");
        let error = String::from_utf8_lossy(&run.stderr);
        assert_eq!(run.status.code(), Some(1), "{command}: {error}");
        for part in ["needs about", "GB", "ulimit -v", advice] {
            assert!(error.contains(part), "{command}: {part}: {error}");
        }
    }
}

/// Wind moves the garden's trees, and all reports say what bringing the scene up to date took.
///
/// Fails when an update is not told, or told as shading; when an estimator begins anew with each frame.
#[test]
fn wind_moves_what_frames_show_and_is_reported() {
    let dir = tempfile::tempdir().expect("a folder");
    let still = ["yard", "--size", "96x60", "--spp", "1", "--devices", "cpu:1"];
    let moving = ["--frames", "3", "--wind", "--estimator", "history"];
    let run = render(dir.path(), &[&still[..], &moving].concat());
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let report = fs::read(dir.path().join("report.json")).expect("a report");
    let report: serde_json::Value = serde_json::from_slice(&report).expect("JSON");
    let updates = report["updates"].as_array().expect("updates");
    let frames: Vec<_> = updates.iter().map(|update| (update["frame"].as_u64(), update["tree"].as_str())).collect();
    assert_eq!(frames, [(Some(1), Some("fitted")), (Some(2), Some("fitted"))]);
    assert_eq!(report["picture"]["wind"].as_f64(), Some(1.0));
    let sum: f64 = updates.iter().map(|update| update["fit_s"].as_f64().expect("seconds")).sum();
    assert!(sum > 0.0 && report["seconds"]["update"].as_f64() > Some(sum), "{report}");
    for stream in report["streams"].as_array().expect("streams") {
        let (frame, fraction) = (stream["frame"].as_u64(), stream["estimate"]["fraction"].as_f64());
        assert_eq!(frame == Some(0), fraction > Some(0.0), "{stream}");
    }
    let text = String::from_utf8_lossy(&run.stdout).into_owned();
    assert!(text.contains("2 fitted, 0 rebuilt"), "{text}");
    let page = fs::read_to_string(dir.path().join("report.html")).expect("a page");
    assert!(page.contains("Moving geometry") && page.contains("2 fitted, 0 rebuilt"));
}
