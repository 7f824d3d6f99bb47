//! Host structs against what naga sees: size, and every member's name and offset.

use omnix_shaders::ALL;

#[test]
fn params_fit_one_stride_and_no_shader_exceeds_the_baseline() {
    for shader in ALL {
        let name = format!("{}/{}", shader.kernel, shader.variant);
        assert!(shader.params_size <= 256, "{name}: Params of {} bytes", shader.params_size);
        let storage = shader.bindings.iter().filter(|b| b.access != omnix_shaders::Access::Uniform).count();
        assert!(storage <= 8, "{name}: {storage} storage buffers, WebGPU offers 8");
    }
    assert!(ALL.len() > 5, "the table lists {} shaders", ALL.len());
}
