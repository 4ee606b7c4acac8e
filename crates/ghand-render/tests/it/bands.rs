//! Pictures rendered in pieces equal those rendered at once.

use crate::common::meshes::{compare, lights, lines, torus};
use crate::common::*;
use ghand_core::Camera;
use ghand_render::mesh::{MeshImage, MeshRenderer};
use ghand_render::splat::{Image, Purpose, SplatModel, SplatOptions, Splatter, View, band_rows};
use ghand_render::{Gpu, RenderError};
use glam::DVec3;

/// A splatter with a scene, for frames of this size.
fn splatter(gpu: &Gpu, model: SplatModel, table: &[f32], size: [u32; 2]) -> Splatter {
    let options = SplatOptions { model, purpose: Purpose::Images, ..SplatOptions::default() };
    let splatter = Splatter::new(gpu, options, table.len() / model.rows(), size).unwrap();
    gpu.queue.write_buffer(splatter.gaussians(), 0, bytemuck::cast_slice(table));
    splatter
}

/// The picture of a view rendered in bands that fit the splatter, and the number of bands.
fn in_bands(gpu: &Gpu, splatter: &mut Splatter, view: View) -> Result<(Image, usize), RenderError> {
    let [width, height] = view.size;
    let mut image = Image { width, height, rgba: vec![] };
    let mut bands = 0;
    splatter.render_bands(gpu, view, |row, band| {
        assert_eq!((row as usize * width as usize, band.width), (image.rgba.len(), width), "bands are contiguous");
        image.rgba.extend(&band.rgba);
        bands += 1;
    })?;
    Ok((image, bands))
}

#[test]
fn bands_equal_the_whole_picture_bit_for_bit() {
    for gpu in devices() {
        let camera = camera(101, 75);
        let kinds = [
            (SplatModel::HAND, random_scene(1, 3000, 0.001..0.03)),
            (SplatModel { antialias: true, ..SplatModel::trained(1) }, general_scene(2, 500, 0.005..0.05, 4)),
        ];
        for (model, scene) in kinds {
            let table = table(&scene, &model);
            let view = View::new(&camera, scene.len(), [0.1, 0.2, 0.3], 0.9);
            let mut whole = splatter(&gpu, model, &table, [101, 75]);
            let (expected, bands) = in_bands(&gpu, &mut whole, view).unwrap();
            assert_eq!((bands, expected.rgba.len()), (1, 101 * 75));
            assert_eq!(expected, {
                whole.set_view(&gpu, view).unwrap();
                whole.render(&gpu).unwrap()
            });
            for (rows, count) in [(8, 10), (24, 4), (31, 4), (72, 2)] {
                let mut small = splatter(&gpu, model, &table, [101, rows]);
                let (image, bands) = in_bands(&gpu, &mut small, view).unwrap();
                assert_eq!(bands, count, "{rows} rows");
                assert!(bits(&image) == bits(&expected), "{rows} rows");
            }
            // The comparison detects a band in the wrong place.
            let mut small = splatter(&gpu, model, &table, [101, 8]);
            small.set_view(&gpu, view.band(8, 8)).unwrap();
            assert!(*bits(&small.render(&gpu).unwrap()) != bits(&expected)[..101 * 8 * 4]);
        }
    }
}

fn bits(image: &Image) -> &[u32] {
    bytemuck::cast_slice(&image.rgba)
}

#[test]
fn the_gradient_of_a_band_equals_that_of_its_rows() {
    for gpu in devices() {
        let camera = camera(50, 40);
        let scene = random_scene(3, 300, 0.002..0.02);
        let table = table(&scene, &SplatModel::HAND);
        let weights = random_weights(7, 50 * 40);
        // Rows 16 to 31 have weights, the others none.
        let inside = 50 * 16..50 * 32;
        let mut masked = weights.clone();
        (0..50 * 40).filter(|i| !inside.contains(i)).for_each(|i| masked[i] = [0.0; 4]);
        let gradient = |size: [u32; 2], band: Option<[u32; 2]>, weights: &[[f32; 4]]| -> Vec<f32> {
            let mut splatter = Splatter::new(&gpu, SplatOptions::default(), scene.len(), size).unwrap();
            gpu.queue.write_buffer(splatter.gaussians(), 0, bytemuck::cast_slice(&table));
            let view = View::new(&camera, scene.len(), [0.0; 3], 0.8);
            splatter.set_view(&gpu, band.map_or(view, |[first, rows]| view.band(first, rows))).unwrap();
            splatter.render(&gpu).unwrap();
            gpu.queue.write_buffer(splatter.d_image(), 0, bytemuck::cast_slice(weights));
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            splatter.backward(&mut encoder);
            gpu.queue.submit([encoder.finish()]);
            ghand_render::buffers::read(&gpu, splatter.d_gaussians(), table.len()).unwrap()
        };
        let whole = gradient([50, 40], None, &masked);
        let band = gradient([50, 16], Some([16, 16]), &weights[inside]);
        let largest = whole.iter().fold(0.0f32, |m, g| m.max(g.abs()));
        assert!(largest > 0.0);
        for (a, b) in whole.iter().zip(&band) {
            assert!((a - b).abs() <= 1e-5 * largest, "{a} {b}, the largest is {largest}");
        }
    }
}

#[test]
fn a_gaussian_over_more_tiles_than_a_driver_can_process_is_rendered_in_smaller_bands() {
    let gpu = gpu();
    let camera = Camera::look_at(DVec3::Z, DVec3::ZERO, DVec3::Y, 0.5, 2112, 2112);
    // 264 x 264 tiles: more than the 65,535 loop iterations of Mesa's software rasteriser.
    let scene = random_scene(5, 1, 3.0..4.0);
    let table = table(&scene, &SplatModel::HAND);
    let mut splatter = splatter(&gpu, SplatModel::HAND, &table, [2112, band_rows(&gpu, [2112, 2112])]);
    let (image, bands) = in_bands(&gpu, &mut splatter, View::new(&camera, 1, [0.0; 3], 1.0)).unwrap();
    println!("{bands} bands");
    assert_eq!(image.rgba.len(), 2112 * 2112);
    assert!(image.rgba.iter().all(|p| p[3] > 0.5), "a part is missing");
    // A single row of tiles that is too wide cannot be halved.
    let mut narrow = self::splatter(&gpu, SplatModel::HAND, &table, [64, 8]);
    let error = in_bands(&gpu, &mut narrow, View::new(&camera, 1, [0.0; 3], 1.0)).unwrap_err().to_string();
    assert!(error.contains("2112"), "{error}");
}

#[test]
fn a_band_fits_the_device() {
    let gpu = gpu();
    let limits = gpu.device.limits();
    assert_eq!(band_rows(&gpu, [512, 512]), 512);
    for size in [[4096, 4096], [16_384, 16_384], [16_384, 100], [8, 16_384]] {
        let rows = band_rows(&gpu, size);
        assert!(rows == size[1] || rows.is_multiple_of(8) && rows > 0, "{size:?}: {rows}");
        assert!(
            16 * u64::from(rows) * u64::from(size[0]) <= limits.max_storage_buffer_binding_size,
            "{size:?}: {rows}"
        );
    }
}

#[test]
fn the_blocks_of_a_large_mesh_image_join_without_a_seam() {
    let torus = torus(40, 24);
    let renderer = MeshRenderer::new(&gpu()).unwrap();
    let far = Camera::look_at(DVec3::new(0.25, -0.2, 0.3), DVec3::ZERO, DVec3::Y, 0.5, 75, 61);
    // Wide enough for two blocks, with the torus at their border.
    let camera = Camera { focal: far.focal * 1.5, ..far.cropped(-984, -20, 1060, 100) };
    let style = lines(2, lights(), 1.5);
    let whole = renderer.render(&torus.textured(), &camera, &style).unwrap();
    assert_eq!((whole.width, whole.height, whole.rgba.len(), whole.depth.len()), (1060, 100, 106_000, 106_000));
    let (left, width): (i32, u32) = (980, 80);
    let window = renderer.render(&torus.textured(), &camera.cropped(left, 0, width, 100), &style).unwrap();
    let cut = |shift: usize| {
        let rows = (0..100usize)
            .map(|y| y * 1060 + left as usize - shift..y * 1060 + (left as usize + width as usize) - shift);
        MeshImage {
            width,
            height: 100,
            rgba: rows.clone().flat_map(|row| whole.rgba[row].to_vec()).collect(),
            depth: rows.flat_map(|row| whole.depth[row].to_vec()).collect(),
        }
    };
    let visible = |x: std::ops::Range<usize>| x.filter(|x| (0..100).any(|y| window.rgba[y * 80 + x][3] > 0.0)).count();
    assert!(visible(30..44) > 10 && visible(44..58) > 10, "the torus is on both sides of the border");
    // Up to 8 samples within rounding of an edge can flip.
    compare(&window, &cut(0), 8).unwrap();
    assert!(compare(&window, &cut(1), 8).is_err(), "the comparison detects a shift");
}
