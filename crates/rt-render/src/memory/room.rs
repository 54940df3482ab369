//! How much memory there is, and refusing what does not fit before any of it is taken.

use super::size;
use crate::{Film, TaskCut};
use rt_balance::DEFAULT_TASK_SIZE;
use rt_scene::streams::Waves;
use std::error::Error;
use std::fmt;
use sysinfo::{MemoryRefreshKind, RefreshKind, System};
#[cfg(unix)]
use sysinfo::{ProcessRefreshKind, ProcessesToUpdate};

/// Bytes of a picture's path while its wave is in flight: where its rays leave, their hits, its pixel and throughput,
/// and on a graphics card the rays themselves. Measured by the growth of the largest resident set with the picture:
/// 75 to 83 on processors, some 60 more for each graphics card whose memory is the host's.
pub const BYTES_PER_PATH: u64 = 256;

/// The same of a caller's ray, with its hit and counts. Measured: 62 on processors, 110 on one graphics card, 170 on a
/// processor and two cards whose memory is the host's.
pub const BYTES_PER_GIVEN_RAY: u64 = 192;

/// The same of a ray of a measured stream, with the answers of all that is compared: a guess that is meant to be too
/// high.
pub const BYTES_PER_MEASURED_RAY: u64 = 512;

/// Bytes that what is recorded of a task takes, and what is written about it: also a guess.
pub const BYTES_PER_TASK: u64 = 512;

/// Bytes that this process can still take, and what limits them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Room {
    /// How many.
    pub bytes: u64,
    limit: &'static str,
}

impl Room {
    /// What there is now; a system that tells nothing is taken to have no end.
    #[must_use]
    pub fn now() -> Self {
        let endless = Self { bytes: u64::MAX, limit: "there is" };
        let memory = RefreshKind::nothing().with_memory(MemoryRefreshKind::everything());
        let Ok(system) = System::new_with_specifics(memory) else { return endless };
        let mut limits = Vec::new();
        if system.total_memory() > 0 {
            let bytes = system.available_memory().saturating_add(system.free_swap());
            limits.push(Self { bytes, limit: "the machine has free" });
        }
        if let Some(group) = system.cgroup_limits() {
            // Not what it has free, of which the cache of files is taken off.
            limits.push(Self { bytes: group.total_memory, limit: "the control group of this process has" });
        }
        limits.extend(address_space(system));
        limits.into_iter().min_by_key(|room| room.bytes).unwrap_or(endless)
    }

    /// Refuses what needs more.
    ///
    /// # Errors
    /// When it does.
    pub fn require(self, bytes: u64, what: &str, advice: &str) -> Result<(), NoRoom> {
        if bytes <= self.bytes {
            return Ok(());
        }
        let Self { limit, bytes: room } = self;
        Err(NoRoom(format!("{what} needs about {}, but {limit} {}: {advice}", size(bytes), size(room))))
    }
}

/// A picture, as far as the memory that it needs goes.
#[derive(Clone, Copy, Debug)]
pub struct PictureNeeds {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Paths of each pixel.
    pub samples: u32,
    /// Diffuse bounces of each path.
    pub bounces: u32,
    /// Frames of the animation.
    pub frames: u32,
    /// How streams are cut into tasks.
    pub cut: TaskCut,
}

/// Least memory in which rays are traced.
const LEAST_WAVE: u64 = 1 << 20;

impl Room {
    /// Cuts a picture into waves of at most `most` bytes for rays and hits.
    ///
    /// # Errors
    /// When there is no room for it.
    pub fn waves(self, picture: &PictureNeeds, most: u64) -> Result<Waves, NoRoom> {
        let PictureNeeds { size: [width, height], samples, bounces, frames, cut } = *picture;
        let pixels = u64::from(width) * u64::from(height);
        // Primary rays, and for each bounce shadow and diffuse ones at most.
        let rays = pixels * u64::from(samples) * u64::from(2 * bounces + 2);
        let tasks = match cut {
            // Smaller ones only where they are few.
            TaskCut::Suited => rays / u64::from(DEFAULT_TASK_SIZE),
            TaskCut::Size(size) => rays / u64::from(size.max(1)),
            TaskCut::Count(tasks) => u64::from(tasks) * u64::from(2 * bounces + 2),
        };
        let records = tasks * u64::from(frames) * BYTES_PER_TASK;
        let kept = pixels * Film::BYTES_PER_PIXEL + records;
        let what = format!(
            "a picture of {width} x {height} pixels ({} bytes a pixel, {} for the records of {tasks} tasks)",
            Film::BYTES_PER_PIXEL,
            size(records),
        );
        self.require(kept + LEAST_WAVE, &what, "choose a smaller --size, or larger tasks")?;
        // What the picture leaves, if that is less than may be used; the scene wants half of it.
        let waves = Waves::new([width, height], samples, BYTES_PER_PATH, most.min((self.bytes - kept) / 2));
        let waves = waves.map_err(|wrong| NoRoom(wrong.to_string()))?;
        let wave = waves.largest() * u64::from(samples) * BYTES_PER_PATH;
        self.require(kept + wave, &format!("{what}, with rays in waves,"), "choose fewer --spp")?;
        Ok(waves)
    }
}

/// Something needs more memory than there is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NoRoom(String);

impl fmt::Display for NoRoom {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl Error for NoRoom {}

/// What `ulimit -v` leaves; `None` where there is no such limit.
#[cfg(unix)]
fn address_space(mut system: System) -> Option<Room> {
    let most = rustix::process::getrlimit(rustix::process::Resource::As).current?;
    let own = sysinfo::get_current_pid().ok()?;
    let what = ProcessRefreshKind::nothing().with_memory();
    system.refresh_processes_specifics(ProcessesToUpdate::Some(&[own]), false, what);
    let taken = system.process(own).map_or(0, sysinfo::Process::virtual_memory);
    Some(Room { bytes: most.saturating_sub(taken), limit: "the limit of its address space (ulimit -v) leaves" })
}

#[cfg(not(unix))]
fn address_space(_: System) -> Option<Room> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_is_refused_with_both_numbers() {
        let room = Room { bytes: 8_000_000_000, limit: "the machine has free" };
        assert!(room.require(8_000_000_000, "it", "wait").is_ok());
        let error = room.require(51_200_000_000, "a picture of 40000 x 40000 pixels", "choose a smaller --size");
        let error = error.unwrap_err().to_string();
        let whole = "a picture of 40000 x 40000 pixels needs about 51 GB, but the machine has free 8.0 GB: \
                     choose a smaller --size";
        assert_eq!(error, whole);
    }

    #[test]
    fn there_is_some_room_and_not_more_than_a_machine_has() {
        let room = Room::now();
        assert!((1 << 20..1 << 50).contains(&room.bytes) || room.bytes == u64::MAX, "{room:?}");
    }
}
