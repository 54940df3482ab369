//! The header is the crate's, and programs in C are built against both libraries, away from the checkout, and run.

use libtest_mimic::{Arguments, Failed, Trial};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

/// Set to write the header instead of comparing it.
const WRITE: &str = "RAYBALANCE_WRITE_HEADER";

const SHARED: &str = "libraybalance.so";
const STATIC: &str = "libraybalance.a";

type Test = fn() -> Result<(), Failed>;

fn main() -> ExitCode {
    let arguments = Arguments::from_args();
    let trial = |name: &str, test: Test| Trial::test(name, test);
    let mut trials = vec![trial("the_header_is_current", the_header_is_current)];
    let programs: [(&str, Test); 4] = [
        ("the_example_runs_with_the_shared_library", || runs("examples/embed.c", SHARED, "5000 of 10000 rays hit")),
        ("the_example_runs_with_the_static_library", || runs("examples/embed.c", STATIC, "5000 of 10000 rays hit")),
        ("misuse_is_an_error_with_words", || runs("crates/raybalance-c/tests/misuse.c", SHARED, "")),
        ("the_header_is_c_plus_plus", the_header_is_c_plus_plus),
    ];
    for (name, test) in programs {
        // What links Rust programs links these; C++ is another matter.
        let reason = match name {
            _ if !cfg!(target_os = "linux") => Some("written for Linux's names of libraries"),
            "the_header_is_c_plus_plus" if !compiles_c_plus_plus() => Some("there is no compiler for C++"),
            _ => None,
        };
        let ignored = reason.map_or_else(|| name.to_owned(), |reason| format!("{name} ({reason})"));
        trials.push(trial(&ignored, test).with_ignored_flag(reason.is_some()));
    }
    libtest_mimic::run(&arguments, trials).exit_code()
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn header() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("include/raybalance.h")
}

/// Mutant: a function, or a word of its description, changed in the crate alone.
fn the_header_is_current() -> Result<(), Failed> {
    let mut made = Vec::new();
    cbindgen::generate(env!("CARGO_MANIFEST_DIR"))?.write(&mut made);
    if std::env::var_os(WRITE).is_some() {
        fs::create_dir_all(header().parent().ok_or("no folder")?)?;
        fs::write(header(), &made)?;
    }
    if fs::read(header())? == made {
        Ok(())
    } else {
        Err(format!("it is another: run this test with {WRITE}=1").into())
    }
}

/// The library that cargo built for this test, which lies beside it or a folder above.
fn library(name: &str) -> Result<PathBuf, Failed> {
    let own = std::env::current_exe()?;
    let deps = own.parent().ok_or("no folder")?;
    let (stem, ending) = name.split_once('.').ok_or("no ending")?;
    let is_it = |path: &PathBuf| {
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        name.starts_with(stem) && name.ends_with(&format!(".{ending}"))
    };
    let built = fs::read_dir(deps)?.filter_map(|entry| Some(entry.ok()?.path())).filter(is_it);
    let newest = built.max_by_key(|path| fs::metadata(path).and_then(|about| about.modified()).ok());
    newest.ok_or_else(|| format!("cargo built no {name} in {}", deps.display()).into())
}

/// Builds a program in a folder that has it, the header and the library, and nothing of the checkout.
fn runs(program: &str, library_name: &str, said: &str) -> Result<(), Failed> {
    let folder = tempfile::tempdir()?;
    fs::copy(library(library_name)?, folder.path().join(library_name))?;
    fs::copy(header(), folder.path().join("raybalance.h"))?;
    fs::copy(root().join(program), folder.path().join("program.c"))?;
    let mut compiler = Command::new("cc");
    compiler.args(["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "program.c", "-o", "program"]);
    compiler.args(["-I.", "-L.", "-Wl,-rpath,$ORIGIN", "-lraybalance", "-lm", "-lpthread", "-ldl"]);
    succeed(compiler.current_dir(folder.path()))?;
    let output = succeed(&mut Command::new(folder.path().join("program")))?;
    if output.contains(said) { Ok(()) } else { Err(format!("it says `{output}`").into()) }
}

fn compiles_c_plus_plus() -> bool {
    Command::new("c++").arg("--version").output().is_ok_and(|output| output.status.success())
}

fn the_header_is_c_plus_plus() -> Result<(), Failed> {
    let mut compiler = Command::new("c++");
    succeed(compiler.args(["-std=c++11", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", "-x", "c++"]).arg(header()))?;
    Ok(())
}

/// Runs a program that must succeed; what it printed.
fn succeed(command: &mut Command) -> Result<String, Failed> {
    let output = command.output()?;
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    if output.status.success() {
        Ok(text(&output.stdout))
    } else {
        Err(format!("{command:?}: {}\n{}{}", output.status, text(&output.stdout), text(&output.stderr)).into())
    }
}
