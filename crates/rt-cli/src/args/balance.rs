//! How work is cut, estimated and dealt.

use super::CardArgs;
use super::parse::{parse_fraction, parse_seconds, parse_share};
use clap::{Args, ValueEnum};
use std::time::Duration;

/// How the cost of a task is estimated.
#[derive(Clone, Debug, Args)]
pub(crate) struct EstimateArgs {
    /// How the cost of a task is estimated
    #[arg(long, value_enum, default_value_t = EstimatorArg::Auto)]
    pub(crate) estimator: EstimatorArg,
    /// Share of the rays that is sampled for the estimate, from 1/4096 to 1 (such as 1/64 or 0.0156); default 1/64;
    /// the estimator auto follows its budget instead, and adaptive begins with 1/256
    #[arg(long, value_parser = parse_fraction, value_name = "F")]
    pub(crate) fraction: Option<f64>,
    /// Share of the trace that the estimator auto may spend on sampling (such as 0.005)
    #[arg(long, value_parser = parse_share, default_value = "0.005", value_name = "F")]
    pub(crate) budget: f64,
    /// What a reduced walk does at a leaf
    #[arg(long, value_enum, default_value_t = ReducedArg::Leaf)]
    pub(crate) reduced: ReducedArg,
}

/// How work is cut, estimated and dealt.
#[derive(Clone, Debug, Args)]
pub(crate) struct BalanceArgs {
    /// Devices, such as cpu:1,cpu:1@0.5,vulkan:0 (threads, speed, number) or auto: one per core and every graphics card
    #[arg(long, value_name = "LIST")]
    pub(crate) devices: Option<String>,
    #[command(flatten)]
    pub(crate) cards: CardArgs,
    #[command(flatten)]
    pub(crate) estimate: EstimateArgs,
    /// How tasks are dealt to devices (static queue; the hybrid queue takes lpt only, the central queue none)
    #[arg(long, value_enum)]
    pub(crate) policy: Option<PolicyArg>,
    /// How devices get their tasks
    #[arg(long, value_enum, default_value_t = QueueArg::Hybrid)]
    pub(crate) queue: QueueArg,
    /// Number of tasks per stream
    #[arg(long, conflicts_with = "task_size", value_parser = clap::value_parser!(u32).range(1..), value_name = "N")]
    pub(crate) tasks: Option<u32>,
    /// Rays per task [default: 1024]
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..), value_name = "RAYS")]
    pub(crate) task_size: Option<u32>,
    /// How long a device may be busy with one launch until it is given up; the others do its work long before
    #[arg(long, value_parser = parse_seconds, default_value = "600", value_name = "SECONDS")]
    pub(crate) device_limit: Duration,
    /// Seed of samples, pixels and bounces
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum EstimatorArg {
    /// Whichever of exact, field and history predicted such streams best, within --budget
    Auto,
    /// All rays cost the same
    Uniform,
    /// Box and triangle tests of sampled rays, without triangles
    Reduced,
    /// Full traversal of sampled rays, whose hits are kept
    Exact,
    /// As exact, with as many samples as they are worth, where they are worth most
    Adaptive,
    /// As exact, with a map of where in the scene rays are dear
    Field,
    /// Measured times of the previous pass or frame
    History,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ReducedArg {
    /// A leaf entered counts as the hit
    Leaf,
    /// The ray is never shortened
    Unshortened,
    /// The ray is cut by a plane for each leaf, as often as its triangles cover it (CPU devices)
    Plane,
    /// Only the top of the tree is walked, over calibrated stubs (CPU devices)
    Truncated,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum PolicyArg {
    /// Contiguous blocks of tasks
    Block,
    /// Tasks in turn
    RoundRobin,
    /// Dearest remaining task to the device that would finish it first
    Lpt,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum QueueArg {
    /// One launch per device with its whole share
    Static,
    /// One task per launch, dearest first
    Central,
    /// Static shares in geometric launches, with stealing
    Hybrid,
}
