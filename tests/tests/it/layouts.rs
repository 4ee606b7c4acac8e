//! Host structs have the same memory layout as the WGSL structs of the same name.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]
#![allow(clippy::neg_cmp_op_on_partial_ord, reason = "`!(error <= bound)` rejects NaN too")]

use std::collections::BTreeMap;

use ghand_avatar::deform::baked::{BakedUniforms, GROUP, SMALLEST_SCALE};
use ghand_avatar::deform::{BLOCK, CHAIN_STRIDE, JointSums, PoseUniforms, ROW_MOMENT, SumUniforms};
use ghand_avatar::properties::direct::ResponseUniforms;
use ghand_render::image_loss::LossUniforms;
use ghand_render::mesh::{MeshUniforms, ResolveUniforms, WireframeUniforms};
use ghand_render::optimizer::AdamUniforms;
use ghand_render::penalty::PenaltyUniforms;
use ghand_render::reference;
use ghand_render::roughness::RoughnessUniforms;
use ghand_render::splat::{Counters, ScanUniforms, SortUniforms, Splat, StrandUniforms, View, shared_constants};
use ghand_render::texture_pass::Place;
use ghand_tests::shaders::{sources, validate};
use naga::{AddressSpace, Module, TypeInner};

/// Position of a member, bytes.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Member {
    name: String,
    offset: usize,
    size: usize,
}

/// Positions of all members of a struct, in the order of its source.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Layout {
    name: String,
    size: usize,
    members: Vec<Member>,
}

/// The layout of a host struct. All of its fields must be listed: a missing one does not compile.
macro_rules! host_layout {
    ($host:ident { $($field:ident),+ $(,)? }) => {{
        fn _lists_every_field($host { $($field: _),+ }: $host) {}
        Layout {
            name: stringify!($host).to_owned(),
            size: size_of::<$host>(),
            members: vec![$(Member {
                name: stringify!($field).to_owned(),
                offset: std::mem::offset_of!($host, $field),
                size: field_size(|s: &$host| &s.$field),
            }),+],
        }
    }};
}

fn field_size<S, F>(_: fn(&S) -> &F) -> usize {
    size_of::<F>()
}

fn host_layouts() -> Vec<Layout> {
    vec![
        host_layout!(View {
            row_x,
            row_y,
            row_z,
            focal,
            principal,
            background,
            size,
            tiles,
            slope_min,
            slope_max,
            gaussian_count,
            intersection_capacity,
            near,
            opacity,
            first_row,
            padding_1,
            padding_2,
            padding_3,
        }),
        host_layout!(Splat { mean, depth, opacity, conic, slot_origin, color, slot_columns }),
        host_layout!(ScanUniforms { length, total_index, padding }),
        host_layout!(SortUniforms { shift, mask, strands, counter, numbered, padding_1, padding_2, padding_3 }),
        host_layout!(StrandUniforms { strands, padding_1, padding_2, padding_3 }),
        host_layout!(Place { origin, size, background, depth_from_z, padding }),
        host_layout!(LossUniforms { size, l1_weight, ssim_weight, inverse_count, summands, padding }),
        host_layout!(PoseUniforms {
            gaussian_count,
            joint_count,
            basis_count,
            pose_offset,
            anchored,
            zero_sum,
            table_columns,
            table_first,
        }),
        host_layout!(SumUniforms { count, left_rows, right_rows, right_offset }),
        host_layout!(AdamUniforms {
            count,
            parameter_offset,
            gradient_offset,
            learning_rate,
            beta_1,
            beta_2,
            epsilon,
            correction_1,
            correction_2,
            padding_1,
            padding_2,
            padding_3,
        }),
        host_layout!(ResponseUniforms { coefficient_rows, color_components, max_scale, padding }),
        host_layout!(BakedUniforms {
            corner,
            max_scale,
            size,
            component_count,
            group_count,
            joints_start,
            entries_start,
            weights_start,
            values_start,
            padding_1,
            padding_2,
            padding_3,
        }),
        host_layout!(PenaltyUniforms { count, weight, padding }),
        host_layout!(RoughnessUniforms {
            count,
            rows,
            neighbors,
            weight,
            inverse_squared_width,
            padding_a,
            padding_b,
            padding_c
        }),
        host_layout!(Counters {
            gaussians,
            intersections,
            intersections_wanted,
            broken,
            cut_short,
            too_wide,
            bad_gradients,
            padding,
        }),
        host_layout!(MeshUniforms { clip_x, clip_y, settings, modes, ambient, light_directions, light_colors }),
        host_layout!(WireframeUniforms { size, half_width, padding }),
        host_layout!(ResolveUniforms { size, supersample, margin, line_color }),
    ]
}

/// The layout of a type if it is a struct.
fn wgsl_layout(module: &Module, ty: &naga::Type) -> Option<Layout> {
    let TypeInner::Struct { members, span } = &ty.inner else { return None };
    let members = members
        .iter()
        .map(|m| Member {
            name: m.name.clone().unwrap_or_default(),
            offset: m.offset as usize,
            size: module.types[m.ty].inner.size(module.to_ctx()) as usize,
        })
        .collect();
    Some(Layout { name: ty.name.clone().unwrap_or_default(), size: *span as usize, members })
}

/// The structs in a module's buffers, as a whole or as the elements of an array.
fn buffer_layouts(module: &Module) -> Vec<Layout> {
    module
        .global_variables
        .iter()
        .filter(|(_, v)| matches!(v.space, AddressSpace::Uniform | AddressSpace::Storage { .. }))
        .filter_map(|(_, v)| {
            let ty = match module.types[v.ty].inner {
                TypeInner::Array { base, .. } => &module.types[base],
                _ => &module.types[v.ty],
            };
            wgsl_layout(module, ty)
        })
        .collect()
}

/// Fails if a host struct cannot be copied to a WGSL struct, with the reason.
fn compare(host: &Layout, wgsl: &Layout) -> Result<(), String> {
    for i in 0..host.members.len().max(wgsl.members.len()) {
        let (h, w) = (host.members.get(i), wgsl.members.get(i));
        if h != w {
            return Err(format!("{}: member {i} is {h:?} on the host and {w:?} in WGSL", host.name));
        }
    }
    if host.size != wgsl.size {
        return Err(format!("{}: {} bytes on the host and {} in WGSL", host.name, host.size, wgsl.size));
    }
    Ok(())
}

#[test]
fn every_struct_in_a_buffer_has_the_same_layout_on_the_host() {
    let mut unseen: BTreeMap<String, Layout> = host_layouts().into_iter().map(|l| (l.name.clone(), l)).collect();
    let hosts = unseen.clone();
    for (source_name, tier, source) in sources() {
        for wgsl in buffer_layouts(&validate(tier, source).unwrap()) {
            let host = hosts.get(&wgsl.name);
            let host =
                host.unwrap_or_else(|| panic!("{source_name}: there is no host struct for {} in this test", wgsl.name));
            compare(host, &wgsl).unwrap_or_else(|e| panic!("{source_name}: {e}"));
            unseen.remove(&wgsl.name);
        }
    }
    assert!(unseen.is_empty(), "no shader has a buffer of {:?}", unseen.keys());
}

/// The value of a constant of a source, or what an override is unless it is set, if it exists and is a number.
fn constant(source: &str, name: &str) -> Option<f64> {
    let module = validate(true, source).unwrap();
    let constant = module.constants.iter().find(|(_, c)| c.name.as_deref() == Some(name)).map(|(_, c)| c.init);
    let default = || module.overrides.iter().find(|(_, o)| o.name.as_deref() == Some(name)).and_then(|(_, o)| o.init);
    match module.global_expressions[constant.or_else(default)?] {
        naga::Expression::Literal(naga::Literal::U32(value)) => Some(value.into()),
        naga::Expression::Literal(naga::Literal::I32(value)) => Some(value.into()),
        naga::Expression::Literal(naga::Literal::F32(value)) => Some(value.into()),
        _ => None,
    }
}

#[test]
fn constants_that_shaders_and_host_code_share_are_equal() {
    let deform = [
        ("skeleton", "CHAIN_STRIDE", CHAIN_STRIDE as u32),
        ("skin_backward", "ROW_MOMENT", ROW_MOMENT),
        ("joint_sums", "STRANDS", JointSums::STRANDS as u32),
        ("skin", "BLOCK", BLOCK as u32),
    ];
    let baked = [("baked", "GROUP", GROUP as f64), ("baked", "SMALLEST_SCALE", SMALLEST_SCALE)];
    let sources = sources();
    let whole = shared_constants().into_iter().chain(deform).map(|(stage, name, host)| (stage, name, f64::from(host)));
    for (stage, name, host) in whole.chain(reference::shared_constants()).chain(baked) {
        let (.., source) = sources.iter().find(|(known, ..)| *known == stage).unwrap();
        // WGSL's numbers are f32.
        let same = |value: f64| value == host || value as f32 == host as f32;
        assert!(
            constant(source, name).is_some_and(same),
            "{stage}: {name} is {:?}, not {host}",
            constant(source, name)
        );
        assert_eq!(constant(source, "NO_SUCH_NAME"), None);
    }
    assert_eq!(constant("const A: u32 = 3u * 4u; @compute @workgroup_size(A) fn f() {}", "A"), Some(12.0));
    assert_eq!(constant("const B: f32 = 1.0 / 4.0; @compute @workgroup_size(1) fn f() { _ = B; }", "B"), Some(0.25));
}

const PAIR: &str = "struct Pair { first: u32, second: vec2<f32> }
    @group(0) @binding(0) var<uniform> pair: Pair;";

fn layout_of(source: &str) -> Layout {
    buffer_layouts(&validate(false, source).unwrap_or_else(|e| panic!("{e}"))).remove(0)
}

#[test]
fn a_host_struct_without_the_padding_of_wgsl_is_rejected() {
    #[repr(C)]
    struct Pair {
        first: u32,
        second: [f32; 2],
    }
    // WGSL aligns a vec2 to 8 bytes, the host aligns an array to 4.
    let error = compare(&host_layout!(Pair { first, second }), &layout_of(PAIR)).unwrap_err();
    assert!(error.contains("member 1"), "{error}");
}

#[test]
fn a_member_of_another_name_size_or_offset_and_a_missing_or_surplus_one_are_rejected() {
    let right = layout_of(PAIR);
    assert_eq!(compare(&right, &right), Ok(()));
    let wrong: [fn(&mut Layout); 6] = [
        |l| l.members[0].name = "other".into(),
        |l| l.members[0].size += 4,
        |l| l.members[1].offset += 4,
        |l| l.members.swap(0, 1),
        |l| drop(l.members.pop()),
        |l| l.size += 8,
    ];
    for (i, change) in wrong.iter().enumerate() {
        let mut layout = right.clone();
        change(&mut layout);
        assert!(compare(&layout, &right).is_err(), "change {i} of the host struct went unnoticed");
        assert!(compare(&right, &layout).is_err(), "change {i} of the WGSL struct went unnoticed");
    }
}
