//! `report.html` of every command, in a real browser: loads without a word on the console, asks nothing of the network,
//! and answers the pointer.
//!
//! Without Chromium the tests that need it are ignored, with the reason, unless `RT_REQUIRE` names `chromium`.

use libtest_mimic::{Arguments, Completion, Failed, Trial, run};
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

type Outcome = Result<(), Failed>;

/// What writes a page: the command's arguments without `--out`.
const PAGES: [(&str, &[&str]); 4] = [
    // Enough samples of each task for a standard error.
    (
        "render",
        &[
            "render",
            "car",
            "--size",
            "64x40",
            "--task-size",
            "1024",
            "--spp",
            "1",
            "--devices",
            "cpu:1",
            "--estimator",
            "exact",
            "--fraction",
            "1/8",
        ],
    ),
    ("figure1", &["figure1", "car", "--size", "48x32", "--repeat", "2", "--task-sizes", "64,256", "--replay", "3"]),
    (
        "compare",
        &[
            "compare",
            "car",
            "--size",
            "48x32",
            "--spp",
            "1",
            "--repeat",
            "1",
            "--devices",
            "cpu:1,cpu:1",
            "--queue",
            "static",
            "--estimator",
            "exact",
        ],
    ),
    ("tradeoff", &["tradeoff", "car", "--quick", "--size", "24x16", "--repeat", "1"]),
];

fn main() {
    let arguments = Arguments::from_args();
    let mut trials: Vec<Trial> = PAGES
        .iter()
        .map(|&(name, command)| Trial::test(format!("{name}_needs_nothing_from_outside"), move || is_closed(command)))
        .collect();
    trials.extend(PAGES.iter().map(|&(name, command)| {
        in_browser(&format!("{name}_loads_silently"), move |browser| loads_silently(browser, command))
    }));
    trials.push(in_browser("a_complaint_is_noticed", complaint_is_noticed));
    trials.push(in_browser("tasks_are_read_out", tasks_are_read_out));
    trials.push(in_browser("a_phone_can_read_it", phone_can_read_it));
    trials.push(in_browser("an_estimate_that_was_not_made_is_a_map_too", unused_estimate_is_shown));
    run(&arguments, trials).exit();
}

fn in_browser(name: &str, test: impl FnOnce(&Path) -> Outcome + Send + 'static) -> Trial {
    Trial::ignorable_test(name, move || {
        if let Some(browser) = browser() {
            return test(&browser).map(|()| Completion::Completed);
        }
        let required = std::env::var("RT_REQUIRE").unwrap_or_default();
        let reason = "no Chromium on PATH: `cargo xtask setup` installs it, or CHROMIUM names one";
        if required.split(',').any(|entry| entry.trim() == "chromium") {
            return Err(format!("required by RT_REQUIRE, but missing: {reason}").into());
        }
        Ok(Completion::ignored_with(reason))
    })
}

fn browser() -> Option<PathBuf> {
    let named = std::env::var_os("CHROMIUM").map(PathBuf::from);
    let path = std::env::var_os("PATH").unwrap_or_default();
    let on_path = |name: &str| std::env::split_paths(&path).map(|folder| folder.join(name)).find(|file| file.is_file());
    named.or_else(|| ["chromium", "chromium-browser", "google-chrome"].into_iter().find_map(on_path))
}

/// Runs the command into a folder of its own and returns that and the page.
fn written(command: &[&str]) -> Result<(tempfile::TempDir, String), Failed> {
    let folder = tempfile::tempdir()?;
    let mut raybalance = Command::new(env!("CARGO_BIN_EXE_raybalance"));
    let output = raybalance.args(command).arg("--out").arg(folder.path()).output()?;
    if !output.status.success() {
        return Err(format!("{command:?} failed: {}", String::from_utf8_lossy(&output.stderr)).into());
    }
    let page = fs::read_to_string(folder.path().join("report.html"))?;
    Ok((folder, page))
}

/// What a browser made of a page.
struct Loaded {
    /// The document after its scripts.
    dom: String,
    /// Lines that the page wrote to the console, errors and refused requests among them.
    console: Vec<String>,
}

fn load(browser: &Path, folder: &Path, page: &str) -> Result<Loaded, Failed> {
    load_at(browser, folder, page, 1000)
}

/// In a window so many pixels wide.
fn load_at(browser: &Path, folder: &Path, page: &str, width: u32) -> Result<Loaded, Failed> {
    let file = folder.join("loaded.html");
    fs::write(&file, page)?;
    let mut profile = OsString::from("--user-data-dir=");
    profile.push(folder.join("profile"));
    let output = Command::new(browser)
        // The sandbox needs rights that containers do not give; the page is our own.
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--enable-logging=stderr"])
        // Time passes as fast as the page allows, so nothing here waits for a clock.
        .args(["--virtual-time-budget=10000", "--dump-dom"])
        .arg(format!("--window-size={width},2000"))
        .arg(profile)
        .arg(&file)
        // Some of what it keeps goes below the home folder whatever its profile.
        .env("HOME", folder)
        .env_remove("XDG_CONFIG_HOME")
        .env_remove("XDG_CACHE_HOME")
        .output()?;
    let log = String::from_utf8_lossy(&output.stderr);
    let console = log.lines().filter(|line| line.contains(":CONSOLE")).map(str::to_owned).collect();
    let dom = String::from_utf8_lossy(&output.stdout).into_owned();
    if !dom.contains("</html>") {
        return Err(format!("the browser wrote no document; it said:\n{log}").into());
    }
    Ok(Loaded { dom, console })
}

/// Nothing in the file names anything outside it, and the browser is told to fetch nothing.
///
/// Fails when the template links a font or a script of some server, or loses its policy.
fn is_closed(command: &[&str]) -> Outcome {
    let (_folder, page) = written(command)?;
    // The names of XML's vocabularies look like addresses, but nobody fetches them.
    let named = page.replace("xmlns=\"http://www.w3.org/2000/svg\"", "");
    for outside in ["http:", "https:", "//www", "@import", "src=\"/", "url("] {
        if let Some(at) = named.find(outside) {
            let near: String = named[at..].chars().take(80).collect();
            return Err(format!("the page names something outside: {near}").into());
        }
    }
    let policy = "http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'";
    if !page.contains(policy) || page.contains("{{") {
        return Err("the page lacks its policy, or a place of the template is empty".into());
    }
    Ok(())
}

/// Fails when the script throws, the policy forbids something that the page needs, or a picture is broken.
fn loads_silently(browser: &Path, command: &[&str]) -> Outcome {
    let (folder, page) = written(command)?;
    let check = "document.documentElement.dataset.result = \
                 [...document.images].every((image) => image.naturalWidth > 0) \
                 && document.querySelectorAll('h2').length > 2;";
    let loaded = load(browser, folder.path(), &with_script(&page, check))?;
    if !loaded.console.is_empty() {
        return Err(format!("the console says: {}", loaded.console.join("\n")).into());
    }
    expect(&result(&loaded.dom), "true")
}

/// The test above would see an error.
fn complaint_is_noticed(browser: &Path) -> Outcome {
    let folder = tempfile::tempdir()?;
    let page = "<!DOCTYPE html><html><head>\
                <meta http-equiv=\"Content-Security-Policy\" content=\"img-src 'none'\"></head><body>\
                <script>nowhere.to.be.found();</script><img src=\"data:image/png;base64,\"></body></html>";
    let loaded = load(browser, folder.path(), page)?;
    let noticed = |what: &str| loaded.console.iter().any(|line| line.contains(what));
    if noticed("nowhere is not defined") && noticed("Content Security Policy") {
        return Ok(());
    }
    Err(format!("not on the console: {:?}", loaded.console).into())
}

/// Pointing at a task fills in its row, and arrow keys go on from there.
///
/// Fails when the map is decoded from the wrong end, the pointer's place is not scaled to the picture's pixels, or no
/// listener is there.
fn tasks_are_read_out(browser: &Path) -> Outcome {
    let (folder, page) = written(PAGES[0].1)?;
    let script = r#"
const field = (name) => document.querySelector(`dd[data-field='${name}']`).textContent;
const canvas = document.querySelector(".maps canvas");
const box = canvas.getBoundingClientRect();
const point = (x, y) => canvas.dispatchEvent(new PointerEvent("pointermove", {
  clientX: box.left + x * box.width, clientY: box.top + y * box.height, bubbles: true }));
const before = field("task");
point(0.01, 0.01);
const first = ["task", "rays", "estimated tests", "estimated time", "measured time", "device"].map(field);
point(0.99, 0.99);
const last = field("task");
canvas.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowLeft", bubbles: true }));
document.documentElement.dataset.result = JSON.stringify([before, first, last, field("task")]);
"#;
    let loaded = load(browser, folder.path(), &with_script(&page, script))?;
    let text = result(&loaded.dom).replace("&quot;", "\"");
    let value: serde_json::Value = serde_json::from_str(&text).map_err(|error| format!("{error}: {text}"))?;
    let word = |value: &serde_json::Value| value.as_str().unwrap_or_default().to_owned();
    // 64 × 40 pixels in tasks of 1,024 rays: two whole tiles of 32 × 32 pixels above, what is left of two below.
    expect(&word(&value[0]), "–")?;
    expect(&word(&value[1][0]), "0")?;
    expect(&word(&value[2]), "2")?;
    expect(&word(&value[3]), "1")?;
    for (field, part) in [(1, "1,024"), (2, "±"), (3, "s"), (4, "s"), (5, "CPU 0")] {
        let text = word(&value[1][field]);
        if !text.contains(part) {
            return Err(format!("field {field} says `{text}`, which lacks `{part}`").into());
        }
    }
    Ok(())
}

/// On a narrow screen letters of charts have 11 pixels at least and the page does not scroll sideways; the files that
/// it links are there, its camera can be typed, and bars of the timeline say what they are.
///
/// Fails when charts shrink with the screen, or a file is linked that is not written.
fn phone_can_read_it(browser: &Path) -> Outcome {
    let command = ["render", "car", "--size", "64x40", "--spp", "2", "--devices", "cpu:1,cpu:1", "--frames", "2"];
    let (folder, page) = written(&command)?;
    let script = r#"
const letters = [...document.querySelectorAll(".chart svg")].flatMap((svg) => {
  const scale = svg.getBoundingClientRect().width / svg.viewBox.baseVal.width;
  return [...svg.querySelectorAll("text")].map((text) => scale * parseFloat(text.getAttribute("font-size")));
});
document.documentElement.dataset.result = JSON.stringify({
  least: Math.min(...letters),
  sideways: document.documentElement.scrollWidth - innerWidth,
  files: [...document.querySelectorAll("li a")].map((link) => link.getAttribute("href")),
  bars: document.querySelectorAll("rect title").length,
  camera: [...document.querySelectorAll("main code")].map((code) => code.textContent),
});
"#;
    let loaded = load_at(browser, folder.path(), &with_script(&page, script), 420)?;
    let text = result(&loaded.dom).replace("&quot;", "\"");
    let found: serde_json::Value = serde_json::from_str(&text).map_err(|error| format!("{error}: {text}"))?;
    let least = found["least"].as_f64().unwrap_or(0.0);
    if least < 11.0 || found["sideways"].as_f64() > Some(0.0) || found["bars"] == 0 {
        return Err(format!("letters of {least} pixels, or sideways, or bars without words: {text}").into());
    }
    let files = found["files"].as_array().ok_or("no links")?;
    for file in files {
        let file = file.as_str().unwrap_or_default();
        if !folder.path().join(file).is_file() {
            return Err(format!("linked but not there: {file}").into());
        }
    }
    expect(&files.len().to_string(), "6")?;
    if !found["camera"][0].to_string().contains("--eye ") {
        return Err(format!("no camera: {}", found["camera"]).into());
    }
    Ok(())
}

/// Where every ray counted the same the page says so, shows what samples would have predicted in more than one colour,
/// and has the headline that `report.json` has; every head of a table says what it means.
///
/// Fails when a map is painted from what was scheduled by, or nobody samples.
fn unused_estimate_is_shown(browser: &Path) -> Outcome {
    let size = ["--size", "96x64", "--spp", "4", "--task-size", "128"];
    let command = [&["render", "yard", "--devices", "cpu:1,cpu:1", "--estimator", "uniform"][..], &size].concat();
    let (folder, page) = written(&command)?;
    let script = r#"
const colours = (canvas) => {
  const data = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  return new Set(Array.from({ length: data.length / 4 }, (_, i) => data.slice(4 * i, 4 * i + 4).join())).size;
};
const maps = [...document.querySelectorAll(".cost")];
document.documentElement.dataset.result = JSON.stringify({
  lead: document.querySelector(".lead").textContent,
  kinds: maps.map((map) => map.querySelector("h3").textContent),
  titles: [...maps[0].querySelectorAll("h4")].map((title) => title.textContent),
  why: maps[0].querySelector("p").textContent,
  colours: [...maps[0].querySelectorAll(".maps canvas")].map(colours),
  untold: [...document.querySelectorAll("th:not([title])")].map((head) => head.textContent),
});
"#;
    let loaded = load(browser, folder.path(), &with_script(&page, script))?;
    let text = result(&loaded.dom).replace("&quot;", "\"");
    let found: serde_json::Value = serde_json::from_str(&text).map_err(|error| format!("{error}: {text}"))?;
    let report: serde_json::Value = serde_json::from_slice(&fs::read(folder.path().join("report.json"))?)?;
    expect(&found["lead"].to_string(), &report["headline"]["sentence"].to_string())?;
    expect(&found["kinds"].to_string(), r#"["primary rays","shadow 0 rays","diffuse 0 rays","shadow 1 rays"]"#)?;
    expect(&found["untold"].to_string(), r#"["device"]"#)?;
    for (what, part) in [("lead", "Estimating costs first (1 ray in 6"), ("why", "No estimate was made.")] {
        if !found[what].to_string().contains(part) {
            return Err(format!("{what} lacks `{part}`: {}", found[what]).into());
        }
    }
    if !found["titles"][0].to_string().contains("estimated (not used), mean ") {
        return Err(format!("the map is called {}", found["titles"]).into());
    }
    let painted = found["colours"].as_array().is_some_and(|all| all.iter().all(|n| n.as_u64() > Some(8)));
    if painted { Ok(()) } else { Err(format!("maps of few colours: {}", found["colours"]).into()) }
}

/// The page with one more script at its end: its policy allows scripts inside it.
fn with_script(page: &str, script: &str) -> String {
    page.replacen("</body>", &format!("<script>{script}</script></body>"), 1)
}

/// What a test's script left on the document's element.
fn result(dom: &str) -> String {
    let rest = dom.split_once("data-result=\"").map_or("", |(_, rest)| rest);
    rest.split('"').next().unwrap_or_default().to_owned()
}

fn expect(found: &str, wanted: &str) -> Outcome {
    if found == wanted { Ok(()) } else { Err(format!("found `{found}`, wanted `{wanted}`").into()) }
}
