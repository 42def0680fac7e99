/** Textured rectangles. One program draws all of them: pictures, notices, the panel. */

import { buildProgram } from "./gl.js";

const VERTEX = `#version 300 es
layout(location = 0) in vec2 corner;
uniform mat4 clip, place;
out vec2 uv;
void main() {
  uv = vec2(0.5 + 0.5 * corner.x, 0.5 - 0.5 * corner.y);
  gl_Position = clip * place * vec4(corner, 0.0, 1.0);
}`;

// The outermost pixel fades out: a straight edge seen at a slant shows no steps.
const FRAGMENT = `#version 300 es
precision highp float;
in vec2 uv;
uniform sampler2D image;
uniform float brightness;
out vec4 color;
void main() {
  vec2 edge = min(uv, 1.0 - uv) / fwidth(uv);
  vec4 texel = texture(image, uv);
  color = vec4(texel.rgb * brightness, texel.a) * clamp(min(edge.x, edge.y), 0.0, 1.0);
}`;

/** Draws squares of half-width 1, placed by matrices. */
export class Quads {
  /**
   * Build the program.
   * @param {WebGL2RenderingContext} gl The context.
   */
  constructor(gl) {
    this._gl = gl;
    const { program, at } = buildProgram(gl, VERTEX, FRAGMENT, ["clip", "place", "brightness"]);
    this._program = program;
    this._at = at;
    this._vertices = gl.createVertexArray();
    gl.bindVertexArray(this._vertices);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([-1, -1, 1, -1, -1, 1, 1, 1]), gl.STATIC_DRAW);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 0, 0);
    gl.bindVertexArray(null);
  }

  /**
   * Get ready to draw for an eye.
   * @param {Float32Array} clip Clip space from room, 4x4.
   */
  begin(clip) {
    this._gl.useProgram(this._program);
    this._gl.bindVertexArray(this._vertices);
    this._gl.uniformMatrix4fv(this._at.clip, false, clip);
  }

  /**
   * Draw one.
   * @param {Float32Array} place Room from square, 4x4.
   * @param {import("./gl.js").Texture} texture What is on it.
   * @param {number} brightness Of its colours; its opacity stays.
   */
  draw(place, texture, brightness) {
    const gl = this._gl;
    gl.bindTexture(gl.TEXTURE_2D, texture.texture);
    gl.uniformMatrix4fv(this._at.place, false, place);
    gl.uniform1f(this._at.brightness, brightness);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
  }
}
