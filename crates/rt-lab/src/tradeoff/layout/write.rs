//! What was measured, as tables, fronts and raw numbers.

use super::LAYOUTS;
use super::measure::{Row, SceneRows};
use crate::intervals::{with_interval, worth};
use crate::tradeoff::{Setting, file_part};
use anyhow::Result;
use rt_balance::stats::Summary;
use rt_report::chart::front::{self, Chart, Panel, Series};
use rt_report::html::Page;
use rt_report::table::{Table, grouped, quoted, seconds};
use std::fmt::Write as _;

/// How to read the tables.
const NOTES: &str = "Mray/s: of full traversal, in kernels. Speed over two-wide: in the same round. Bytes per triangle: of the \
    layout's nodes, the triangles and their ids; a card that traces over the eight-wide tree also holds the two-wide nodes, over which \
    it counts, in brackets. Made in: the two-wide tree on all cores; the eight-wide one is made of it, on one. Tests of a ray: \
    boxes + triangles; a two-wide node has two boxes, an eight-wide one eight, whatever is in its slots. Hits differing: of closest \
    hits every bit, of any hits whether there is one.";

pub(super) fn all(setting: &Setting<'_>, scenes: &[SceneRows], page: &mut Page) -> Result<()> {
    page.section("Layout of the tree against rays per second");
    for scene in scenes.iter().filter(|scene| !scene.rows.is_empty()) {
        let svg = front::to_svg(&chart(scene))?;
        setting.write_svg(&format!("layout-{}.svg", file_part(&scene.scene)), &svg)?;
        page.chart(
            &svg,
            "Bytes per triangle against million rays per second, one point for each layout, one panel for each kind of rays",
            "Upper left is best. Medians of interleaved rounds; bars are intervals of the median.",
        );
    }
    let table = table(scenes);
    let notes = notes(scenes);
    let on = one_device(scenes).map_or_else(String::new, |device| format!(" on {device}"));
    page.table(&format!("Layouts{on}: medians, intervals in brackets"), &table);
    notes.iter().for_each(|note| page.paragraph(note));
    let words: Vec<String> = notes.iter().map(|note| format!("  {note}")).collect();
    let markdown = format!("{}\n{}\n", table.to_markdown(), notes.join("\n\n"));
    setting.write_markdown("layout.md", &markdown)?;
    setting.write("layout.csv", &csv(setting.csv_head(), scenes))?;
    setting.write_json("layout.json", &scenes)?;
    let words = words.join("\n");
    Ok(setting.time.print(&format!("\nlayout of the tree against rays per second{on}\n\n{table}\n{words}"))?)
}

/// How to read the tables, how sure the intervals are, and what cards have to say.
fn notes(scenes: &[SceneRows]) -> Vec<String> {
    let rows = || scenes.iter().flat_map(|scene| &scene.rows);
    let least = rows().map(|row| row.mray_s).min_by_key(|mray_s| mray_s.count);
    let sure = least.map(|least| format!("Medians; rounds: {} at least. {}", least.count, worth(&least)));
    let mut notes: Vec<String> = std::iter::once(NOTES.to_owned()).chain(sure).collect();
    for row in rows().filter_map(|row| Some(format!("{}, {}: {}.", row.entry, row.layout, row.note.as_ref()?))) {
        if !notes.contains(&row) {
            notes.push(row);
        }
    }
    notes
}

/// The device, if there is only one.
fn one_device(scenes: &[SceneRows]) -> Option<String> {
    let mut rows = scenes.iter().flat_map(|scene| &scene.rows);
    let first = rows.next()?;
    rows.all(|row| row.entry == first.entry).then(|| format!("{}: {}", first.entry, first.device))
}

/// A panel for each device and kind of rays.
fn chart(scene: &SceneRows) -> Chart {
    let device = one_device(std::slice::from_ref(scene));
    let panel = |pair: &[Row]| Panel {
        title: if device.is_some() { pair[0].rays.to_owned() } else { format!("{}, {}", pair[0].rays, pair[0].entry) },
        axes: ["bytes per triangle".to_owned(), "Mray/s".to_owned()],
        series: pair
            .iter()
            .map(|row| Series {
                name: row.layout.to_owned(),
                points: vec![[row.bytes_per_triangle, row.mray_s.median]],
                intervals: vec![[row.mray_s.low, row.mray_s.high]],
            })
            .collect(),
        reference: None,
        levels: Vec::new(),
        front: Some([false, true]),
    };
    let on = device.as_ref().map_or_else(String::new, |device| format!(", on {device}"));
    Chart {
        title: format!("{}: memory of the tree's layout against speed{on}", scene.scene),
        panels: scene.rows.chunks_exact(LAYOUTS.len()).map(panel).collect(),
        columns: 4,
    }
}

fn table(scenes: &[SceneRows]) -> Table {
    let with_device = one_device(scenes).is_none();
    let first = if with_device { &["scene", "device"][..] } else { &["scene"] };
    let header =
        ["rays", "layout", "Mray/s", "over two-wide", "B/triangle", "made in", "tests of a ray", "hits differing"];
    let mut table = Table::new(&[first, &header].concat());
    let interval = |summary: &Summary| with_interval(summary, |value| format!("{value:.2}"));
    for scene in scenes {
        for (index, row) in scene.rows.iter().enumerate() {
            let is_wide = index % LAYOUTS.len() > 0;
            let (bytes, held) = (row.bytes_per_triangle, row.held_bytes_per_triangle);
            let mut cells = vec![scene.scene.clone()];
            cells.extend(with_device.then(|| row.entry.clone()));
            cells.extend([
                row.rays.to_owned(),
                row.layout.to_owned(),
                interval(&row.mray_s),
                if is_wide { interval(&row.over_two) } else { "1".to_owned() },
                if is_wide { format!("{bytes:.1} ({held:.1})") } else { format!("{bytes:.1}") },
                if is_wide { format!("+ {}", seconds(scene.convert.median)) } else { seconds(scene.build.median) },
                format!("{:.1} + {:.1}", row.box_tests, row.triangle_tests),
                if is_wide { format!("{} of {}", row.differing, grouped(row.count.into())) } else { String::new() },
            ]);
            table.row(cells);
        }
    }
    table
}

/// Every layout in every round, one line each.
fn csv(head: String, scenes: &[SceneRows]) -> String {
    let mut text = head
        + "scene,triangles,device,entry,backend,stream,rays,layout,bytes_per_triangle,held_bytes_per_triangle,box_tests,triangle_tests,\
           differing,round,build_s,convert_s,kernel_s,whole_s,mray_s,over_two\n";
    for scene in scenes {
        for pair in scene.rows.chunks_exact(LAYOUTS.len()) {
            for (layout, row) in pair.iter().enumerate() {
                let what = format!(
                    "{},{},{},{},{},{},{},{},{:.3},{:.3},{:.4},{:.4},{}",
                    quoted(&scene.scene),
                    scene.triangles,
                    quoted(&row.device),
                    row.entry,
                    row.backend,
                    row.rays,
                    row.count,
                    row.layout,
                    row.bytes_per_triangle,
                    row.held_bytes_per_triangle,
                    row.box_tests,
                    row.triangle_tests,
                    row.differing,
                );
                for (round, kernel) in row.kernel_s.iter().enumerate() {
                    let of = |values: &[f64]| values.get(round).copied().unwrap_or(f64::NAN);
                    // The two-wide tree is not converted.
                    let convert = if layout == 0 { String::new() } else { format!("{:e}", of(&scene.convert_s)) };
                    let _ = writeln!(
                        text,
                        "{what},{},{:e},{convert},{kernel:e},{:e},{:e},{:e}",
                        round + 1,
                        of(&scene.build_s),
                        of(&row.whole_s),
                        f64::from(row.count) / kernel / 1e6,
                        of(&pair[0].kernel_s) / kernel,
                    );
                }
            }
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::measure::tests::rows;
    use super::*;

    /// Mutants: quotes left as they are; the ratio of the other layout; one line for each layout only.
    #[test]
    fn every_round_has_a_line_as_long_as_the_head() {
        let text = csv("# command: x\n".to_owned(), &[rows()]);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 2 + 2 * 3);
        let fields = lines[1].split(',').count();
        for line in &lines[2..] {
            assert_eq!(line.split(',').count(), fields, "{line}");
            assert!(line.starts_with("\"a \"\"scene\"\"\",1000,\"a card\",vulkan:0,vulkan,diffuse,1000000,"), "{line}");
            assert!(line.ends_with(if line.contains("two-wide") { ",1e0" } else { ",2e0" }), "{line}");
        }
    }

    #[test]
    fn tables_say_what_is_held_and_how_sure_they_are() {
        let mut scene = rows();
        scene.rows[1].note = Some("walks the two-wide tree alone".to_owned());
        let table = table(std::slice::from_ref(&scene));
        assert_eq!(
            table.rows()[2][4..],
            ["2.00 (2.00–2.00)", "45.0 (70.0)", "+ 20.0 ms", "50.0 + 5.0", "0 of 1,000,000"]
        );
        let chart = chart(&scene);
        assert_eq!(chart.panels.len(), 1);
        assert_eq!(chart.panels[0].series[1].points, [[45.0, 1.0]]);
        let notes = notes(&[scene]);
        assert!(notes[1].contains("75%") && notes[1].contains("--repeat 6"), "{notes:?}");
        assert!(notes[2].starts_with("vulkan:0, eight-wide: walks"), "{notes:?}");
    }
}
