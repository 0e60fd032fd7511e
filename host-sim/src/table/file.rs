//! The bytes of a table: see [`cdpr_core::table`] for the format.

use std::collections::HashMap;

use cdpr_core::table::{
    COORDINATES, CRC_BYTES, ELASTIC_CATENARY, MAGIC, MAX_NODES, MAX_SEEDS, NODE_BYTES, Node,
    SEED_BYTES, VERSION, checksum, offset,
};
use cdpr_core::{CABLES, Load, Robot};

use super::Model;
use super::cells::Plan;

/// Why a table cannot be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum WriteFault {
    /// Too many cells.
    #[error(
        "{0} cells of one kind are more than the format holds; take a smaller region or less depth"
    )]
    TooLarge(usize),
}

/// All that the header says.
pub(super) struct Header {
    pub(super) low: [f32; COORDINATES],
    pub(super) extent: [f32; COORDINATES],
    pub(super) sheet_pose: [f32; COORDINATES],
    pub(super) sheet_lengths_m: [f32; CABLES],
    pub(super) limits_m: [f32; CABLES],
}

/// Writes a table.
#[allow(clippy::cast_possible_truncation)] // parameters that are floats already, counts that were checked
pub(super) fn write(
    robot: &Robot<f64, Model>,
    load: &Load<f64>,
    header: &Header,
    plan: &Plan,
) -> Result<Vec<u8>, WriteFault> {
    let mut body = Body::default();
    body.nodes.push(0);
    body.add(plan, 0);
    for (count, most) in [(body.seeds.len(), MAX_SEEDS), (body.nodes.len(), MAX_NODES)] {
        if count > most as usize {
            return Err(WriteFault::TooLarge(count));
        }
    }
    let total =
        offset::TREE + NODE_BYTES * body.nodes.len() + SEED_BYTES * body.seeds.len() + CRC_BYTES;
    let mut bytes = Vec::with_capacity(total);
    bytes.extend(MAGIC);
    bytes.extend(VERSION.to_le_bytes());
    bytes.extend([ELASTIC_CATENARY, body.steps]);
    for count in [total, body.nodes.len(), body.seeds.len(), 0, 0] {
        bytes.extend((count as u32).to_le_bytes());
    }
    let mut floats = |values: &[f32]| bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
    floats(&header.low);
    floats(&header.extent);
    floats(&header.sheet_pose);
    floats(&header.sheet_lengths_m);
    for cable in robot.cables() {
        floats(&cable.anchor_m.map(|c| c as f32).data.0[0]);
        floats(&cable.attachment_m.map(|c| c as f32).data.0[0]);
        floats(&[cable.model.weight_n_m as f32, cable.model.compliance_per_n as f32]);
    }
    floats(&[load.mass_kg as f32]);
    floats(&load.center_of_mass_m.map(|c| c as f32).data.0[0]);
    floats(&[load.gravity_m_s2 as f32]);
    floats(&load.force_n.map(|c| c as f32).data.0[0]);
    floats(&load.moment_nm.map(|c| c as f32).data.0[0]);
    floats(&header.limits_m);
    debug_assert_eq!(bytes.len(), offset::TREE);
    bytes.extend(body.nodes.iter().flat_map(|node| node.to_le_bytes()));
    bytes.extend(body.seeds.iter().flatten().flat_map(|chart| chart.to_le_bytes()));
    bytes.extend(checksum(&bytes).to_le_bytes());
    Ok(bytes)
}

#[derive(Default)]
struct Body {
    nodes: Vec<u32>,
    seeds: Vec<[f32; CABLES]>,
    seed_numbers: HashMap<[u32; CABLES], usize>,
    steps: u8,
}

impl Body {
    fn add(&mut self, plan: &Plan, index: usize) {
        let node = match plan {
            Plan::Split { coordinate, halves } => {
                let first = self.nodes.len();
                self.nodes.extend([0, 0]);
                for (half, child) in halves.iter().zip(first..) {
                    self.add(half, child);
                }
                Node::Split { coordinate: usize::from(*coordinate), first }
            }
            Plan::Cell(cell) => {
                self.steps = self.steps.max(cell.steps);
                let next = self.seeds.len();
                let key = cell.seed.map(f32::to_bits);
                let seed = *self.seed_numbers.entry(key).or_insert(next);
                if seed == next {
                    self.seeds.push(cell.seed);
                }
                Node::Cell { seed }
            }
            Plan::Nothing(gap) => Node::Nothing(*gap),
        };
        self.nodes[index] = node.encode();
    }
}
