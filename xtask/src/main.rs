//! Project automation, run as `cargo xtask`.
#![forbid(unsafe_code)]

mod apt;
mod command;
mod deny;
mod embree;
mod estimation;
mod files;
mod fuzz;
mod nightly;
mod no_std;
mod pip;
mod python;
mod registered;
mod setup;
mod steps;
mod test;
mod unsafe_code;
mod vulkan;
mod width;
mod workspace;

use command::{complain, say};
use std::io::{self, Write};
use std::process::ExitCode;

const USAGE: &str = "\
usage: cargo xtask <task>

  setup           put in place what the tests need from outside, in the folder .setup and by apt; does nothing where it
                  is there already
  setup --undo    remove what earlier versions of `setup` registered below the home folder
  test [--quick]  setup, then every check that a change must pass; --quick leaves out documentation,
                  single features and the no_std proof
  python          build the Python package's wheel, install it into the environment that `setup` made, and test it
                  there
  no-std          prove that rt-core, rt-bvh and rt-sched need no std
  estimation [--quick]
                  measure what docs/results/estimation.md says, into out/estimation; half an hour on two quiet cores,
                  with --quick under three minutes after the build, which shows the form and measures nothing
  loom            try every interleaving of a few devices on the queues
  asan            AddressSanitizer over everything that has unsafe code (needs the nightly compiler)
  fuzz --minutes N
                  libFuzzer on the targets in fuzz/, N minutes in all (needs the nightly compiler)

environment:

  RAYBALANCE_SCENES  folder with *.obj or *.obj.xz and cameras.tsv; tests that need scenes are left out without it
  RT_REQUIRE         what must not be missing, such as `cpu`: a test that lacks it fails instead of being left out;
                     with CI=true everything that `setup` provides, unless set
  CHROMIUM           browser for the tests of report.html; unless set, chromium, chromium-browser or google-chrome
  VK_DRIVER_FILES    Vulkan drivers to be tested, as for any program that uses Vulkan; unless set, three software
                     devices, which `setup` puts into .setup/vulkan. Programs that cargo starts find these beside the
                     machine's own; others do with VK_ADD_DRIVER_FILES=.setup/vulkan/icd.d
  RAYBALANCE_EMBREE  the file of an Embree 4 library for the tests to compare with; unless set, one that `setup`
                     puts into .setup/embree, or the system's
";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let result = match arguments[..] {
        ["setup"] => setup::setup().map(drop),
        ["setup", "--undo"] => registered::undo(),
        ["test"] => test::test(test::Extent::Everything),
        ["test", "--quick"] => test::test(test::Extent::Quick),
        ["python"] => setup::setup().and_then(|_| python::test()),
        ["no-std"] => no_std::prove(),
        ["estimation"] => estimation::estimation(false),
        ["estimation", "--quick"] => estimation::estimation(true),
        ["loom"] => command::run(&mut unsafe_code::loom()),
        ["asan"] => unsafe_code::asan(),
        ["fuzz", "--minutes", minutes] => match minutes.parse() {
            Ok(minutes) => fuzz::fuzz(minutes),
            Err(_) => Err(anyhow::anyhow!("`{minutes}` is not a number of minutes")),
        },
        ["help" | "--help" | "-h"] => {
            say(USAGE.trim_end());
            Ok(())
        }
        _ => {
            let _ = write!(io::stderr(), "{USAGE}");
            return ExitCode::from(2);
        }
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            complain(&error);
            ExitCode::FAILURE
        }
    }
}
