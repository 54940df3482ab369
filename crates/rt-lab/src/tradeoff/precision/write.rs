//! What was measured, as CSV, as tables for the terminal and as a table for a report.

use super::Row;
use crate::intervals::with_interval;
use rt_balance::stats::Summary;
use rt_report::table::{Table, grouped, quoted};
use rt_verify::accuracy::UlpErrors;
use std::io::{self, Write};

/// One line for each row, without raw samples.
pub(super) fn csv(file: &mut dyn Write, rows: &[Row]) -> io::Result<()> {
    writeln!(
        file,
        "scene,triangles,device,entry,backend,stream,precision,kernel,mray_s,mray_s_low,mray_s_high,time_over_fast,time_over_fast_low,\
         time_over_fast_high,rays_compared,false_miss_ppm,false_miss_ppm_low,false_miss_ppm_high,false_hit_ppm,other_id_ppm,\
         t_ulp_p50,t_ulp_p99,t_ulp_max,exact_rays,exact_ambiguous,exact_wrong"
    )?;
    for row in rows {
        let a = &row.accuracy;
        let interval = |m: &Summary| format!("{:.6},{:.6},{:.6}", m.median, m.low, m.high);
        let ulp = a.t_ulp.map_or_else(|| ",,".to_owned(), |u| format!("{:.3},{:.3},{:.3}", u.p50, u.p99, u.max));
        let [low, high] = a.false_misses.bounds_ppm;
        writeln!(
            file,
            "{},{},{},{},{},{},{},{},{},{},{},{:.4},{low:.4},{high:.4},{:.4},{:.4},{ulp},{},{},{}",
            quoted(&row.scene),
            row.triangles,
            quoted(&row.device),
            row.entry,
            row.backend,
            row.rays,
            row.precision,
            row.kernel,
            interval(&row.mray_s),
            interval(&row.time_over_fast),
            a.rays,
            a.false_misses.ppm,
            a.false_hits.ppm,
            a.other_ids.ppm,
            row.exact.rays,
            row.exact.ambiguous,
            row.exact.wrong.count + row.exact.wrong_ambiguous,
        )?;
    }
    Ok(())
}

/// A table for each scene and device, with its title.
pub(super) fn tables(rows: &[Row]) -> Vec<(String, Table)> {
    let mut tables: Vec<(String, Table)> = Vec::new();
    for row in rows {
        let title =
            format!("{}, {} triangles, on {}: {}", row.scene, grouped(row.triangles as u64), row.entry, row.device);
        if tables.last().is_none_or(|(last, _)| *last != title) {
            tables.push((title, new_table()));
        }
        let Some((_, table)) = tables.last_mut() else { continue };
        let a = &row.accuracy;
        let exact = &row.exact;
        table.row(vec![
            row.rays.to_owned(),
            row.precision.to_owned(),
            format!("{:.2}", row.mray_s.median),
            format!("{:.3}", row.time_over_fast.median),
            row.time_over_fast.interval().map_or_else(String::new, |[low, high]| format!("{low:.3} – {high:.3}")),
            ppm(a.false_misses.ppm),
            format!("{} – {}", ppm(a.false_misses.bounds_ppm[0]), ppm(a.false_misses.bounds_ppm[1])),
            ppm(a.false_hits.ppm),
            ppm(a.other_ids.ppm),
            ulps(a.t_ulp),
            format!("{} of {}", exact.wrong.count + exact.wrong_ambiguous, exact.rays),
        ]);
    }
    tables
}

fn new_table() -> Table {
    Table::new(&[
        "rays",
        "precision",
        "Mray/s",
        "time/fast",
        "interval",
        "false miss ppm",
        "95%",
        "false hit",
        "other id",
        "t ulp p50/p99/max",
        "exactly wrong",
    ])
}

fn ppm(ppm: f64) -> String {
    match ppm {
        0.0 => "0".to_owned(),
        ppm if ppm >= 100.0 => grouped(ppm.round() as u64),
        ppm => format!("{ppm:.2}"),
    }
}

/// One Markdown table: what `fast` gets wrong, how exact distances are, and what robustness costs, a line for each
/// stream.
pub(super) fn markdown(file: &mut dyn Write, rows: &[Row]) -> io::Result<()> {
    writeln!(
        file,
        "| scene | device | rays | fast: false misses, false hits, other ids (ppm) | wrong of robust, f64 (ppm) | error of \
         t in ulp, p50 / p99 / max: fast | robust | f64 | exactly wrong: fast, robust, f64 | time over fast: robust | f64 |\n\
         |---|---|---|---|---|---|---|---|---|---|---|"
    )?;
    for [fast, robust, double] in rows.as_chunks::<3>().0 {
        let wrong = |row: &Row| ppm(row.accuracy.wrong.ppm);
        let a = &fast.accuracy;
        let ratio = |row: &Row| with_interval(&row.time_over_fast, |ratio| format!("{ratio:.2}"));
        let judged = |row: &Row| row.exact.wrong.count + row.exact.wrong_ambiguous;
        writeln!(
            file,
            "| {} | {} | {} | {}, {}, {} | {}, {} | {} | {} | {} | {}, {}, {} of {} | {} | {} |",
            short(&fast.scene),
            fast.entry,
            fast.rays,
            ppm(a.false_misses.ppm),
            ppm(a.false_hits.ppm),
            ppm(a.other_ids.ppm),
            wrong(robust),
            wrong(double),
            ulps(fast.accuracy.t_ulp),
            ulps(robust.accuracy.t_ulp),
            ulps(double.accuracy.t_ulp),
            judged(fast),
            judged(robust),
            judged(double),
            fast.exact.rays,
            ratio(robust),
            ratio(double),
        )?;
    }
    Ok(())
}

/// A scene's name without folder and ending.
fn short(scene: &str) -> &str {
    std::path::Path::new(scene).file_stem().and_then(|stem| stem.to_str()).unwrap_or(scene)
}

/// Median, 99% and maximum.
fn ulps(errors: Option<UlpErrors>) -> String {
    let ulp = |u: f64| if u < 100.0 { format!("{u:.2}") } else { grouped(u.round() as u64) };
    errors.map_or_else(|| "–".to_owned(), |u| [u.p50, u.p99, u.max].map(ulp).join(" / "))
}
