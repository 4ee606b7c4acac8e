// One Adam step on a range of a parameter table. CPU twin: `ghand_render::reference::adam`.

import package::shared::dispatch::flat_index;

struct AdamUniforms {
    count: u32,
    parameter_offset: u32,
    gradient_offset: u32,
    learning_rate: f32,
    beta_1: f32,
    beta_2: f32,
    epsilon: f32,
    // 1 / (1 - beta^step), for both moments.
    correction_1: f32,
    correction_2: f32,
    padding_1: u32,
    padding_2: u32,
    padding_3: u32,
}

@group(0) @binding(0) var<uniform> adam: AdamUniforms;
@group(0) @binding(1) var<storage, read_write> parameters: array<f32>;
@group(0) @binding(2) var<storage, read> gradients: array<f32>;
// First and second moment of each parameter.
@group(0) @binding(3) var<storage, read_write> moments: array<vec2<f32>>;

@compute @workgroup_size(64)
fn adam_step(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
             @builtin(local_invocation_index) local: u32) {
    let i = flat_index(group, groups, local, 64u);
    if i >= adam.count {
        return;
    }
    let at = adam.parameter_offset + i;
    let gradient = gradients[adam.gradient_offset + i];
    // Parameters that a view does not see keep their moments: most of a hand is hidden in every view.
    if gradient == 0.0 {
        return;
    }
    let m = mix(gradient, moments[at].x, adam.beta_1);
    let v = mix(gradient * gradient, moments[at].y, adam.beta_2);
    moments[at] = vec2(m, v);
    parameters[at] -= adam.learning_rate * (m * adam.correction_1) / (sqrt(v * adam.correction_2) + adam.epsilon);
}

// The same for vectors of three numbers that share their second moment. All axes of a joint move in proportion to their
// gradients, so that noise does not move an axis that the images say little about as far as one that they show.
@compute @workgroup_size(64)
fn adam_step_vectors(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                     @builtin(local_invocation_index) local: u32) {
    let i = 3u * flat_index(group, groups, local, 64u);
    if i >= adam.count {
        return;
    }
    let at = adam.parameter_offset + i;
    let from_gradient = adam.gradient_offset + i;
    let gradient = vec3(gradients[from_gradient], gradients[from_gradient + 1u], gradients[from_gradient + 2u]);
    if all(gradient == vec3(0.0)) {
        return;
    }
    let v = mix(dot(gradient, gradient) / 3.0, moments[at].y, adam.beta_2);
    let rate = adam.learning_rate * adam.correction_1 / (sqrt(v * adam.correction_2) + adam.epsilon);
    for (var c = 0u; c < 3u; c++) {
        let m = mix(gradient[c], moments[at + c].x, adam.beta_1);
        moments[at + c] = vec2(m, v);
        parameters[at + c] -= rate * m;
    }
}
