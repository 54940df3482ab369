//! How work is cut, estimated and dealt.

use super::parse::{named, parse_devices, parse_fraction, parse_seconds, reduced_walk};
use super::{DeviceArgs, heading};
use clap::Args;
use rt_balance::QueueKind;
use rt_balance::catalogue::{Entry, Make, MakePolicy, POLICIES, QUEUES};
use rt_lab::estimators;
use std::time::Duration;

/// How the cost of a task is estimated.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = heading::SCHEDULING)]
pub(crate) struct EstimateArgs {
    /// How the cost of a task is estimated
    #[arg(long, value_parser = named(estimators::all()), default_value = estimators::all()[0].name,
          value_name = "NAME")]
    pub(crate) estimator: &'static Entry<Make>,
    /// Share of the rays that is sampled for the estimate, from 1/4096 to 1 (such as 1/64 or 0.0156); default 1/64;
    /// adaptive begins with 1/256
    #[arg(long, value_parser = parse_fraction, value_name = "F")]
    pub(crate) fraction: Option<f64>,
    /// What the walk of the estimator reduced does at a leaf [default: leaf]
    #[arg(long, value_parser = reduced_walk(), value_name = "WALK")]
    pub(crate) reduced: Option<&'static Entry<Make>>,
}

/// How work is cut, estimated and dealt.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = heading::SCHEDULING)]
pub(crate) struct BalanceArgs {
    /// Devices, such as cpu:1,cpu:1@0.5,vulkan:0 (threads, speed, number) or auto: one per core and every graphics card
    #[arg(long, help_heading = heading::DEVICES, value_name = "LIST", value_parser = parse_devices)]
    pub(crate) devices: Option<String>,
    #[command(flatten)]
    pub(crate) device: DeviceArgs,
    #[command(flatten)]
    pub(crate) estimate: EstimateArgs,
    /// Print why each stream's estimate was made as it was, with the numbers that decided
    #[arg(long, conflicts_with = "json")]
    pub(crate) explain: bool,
    /// How tasks are dealt to devices, or ordered (central queue)
    #[arg(long, value_parser = named(POLICIES), value_name = "NAME")]
    pub(crate) policy: Option<&'static Entry<MakePolicy>>,
    /// How devices get their tasks
    #[arg(long, value_parser = named(QUEUES), default_value = QUEUES[0].name, value_name = "NAME")]
    pub(crate) queue: &'static Entry<QueueKind>,
    /// Number of tasks per stream; the hybrid queue cuts those that are too large for devices to end together
    #[arg(long, conflicts_with = "task_size", value_parser = clap::value_parser!(u32).range(1..), value_name = "N")]
    pub(crate) tasks: Option<u32>,
    /// Rays per task [default: 1024, or 512 or 256 where devices would have less than 64 tasks]
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..), value_name = "RAYS")]
    pub(crate) task_size: Option<u32>,
    /// How long a device may be busy with one launch until it is given up; the others do its work long before
    #[arg(long, help_heading = heading::DEVICES, value_parser = parse_seconds, default_value = "600",
          value_name = "SECONDS")]
    pub(crate) device_limit: Duration,
    /// Seed of samples, pixels and bounces
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u32,
}
