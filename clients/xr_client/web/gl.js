/** What WebGL needs several lines for: programs, textures. */

/**
 * Compile and link a program.
 * @param {WebGL2RenderingContext} gl The context.
 * @param {string} vertex Vertex shader, GLSL ES 3.00.
 * @param {string} fragment Fragment shader, GLSL ES 3.00.
 * @param {string[]} uniforms Names to look up.
 * @returns {{program: WebGLProgram, at: Object<string, WebGLUniformLocation>}} The program and its uniforms by name.
 * @throws {Error} It does not compile: the browser's words.
 */
export function buildProgram(gl, vertex, fragment, uniforms) {
  const program = gl.createProgram();
  for (const [kind, source] of [
    [gl.VERTEX_SHADER, vertex],
    [gl.FRAGMENT_SHADER, fragment],
  ]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
    gl.deleteShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost()) {
      throw new Error(`a shader does not compile: ${gl.getShaderInfoLog(shader)}`);
    }
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
    throw new Error(`a program does not link: ${gl.getProgramInfoLog(program)}`);
  }
  return { program, at: Object.fromEntries(uniforms.map((name) => [name, gl.getUniformLocation(program, name)])) };
}

/** A texture that is replaced as a whole; of one dark point until then. */
export class Texture {
  /**
   * Make it.
   * @param {WebGL2RenderingContext} gl The context.
   * @param {{mipmaps?: boolean, rgba?: number[]}} options Whether it is seen smaller than it is, as text may be; and
   *   the colour of the point, 0 to 255.
   */
  constructor(gl, { mipmaps = false, rgba = [0, 0, 0, 0] } = {}) {
    this._gl = gl;
    this._mipmaps = mipmaps;
    this._width = 0;
    this._height = 0;
    this.texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, mipmaps ? gl.LINEAR_MIPMAP_LINEAR : gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 1, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(rgba));
  }

  /**
   * Replace what is on it.
   * @param {ImageBitmap|HTMLCanvasElement} image The image; its top row is the texture's first.
   */
  upload(image) {
    const gl = this._gl;
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    gl.pixelStorei(gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, true);
    if (image.width === this._width && image.height === this._height) {
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, gl.RGBA, gl.UNSIGNED_BYTE, image);
    } else {
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, image);
      this._width = image.width;
      this._height = image.height;
    }
    if (this._mipmaps) {
      gl.generateMipmap(gl.TEXTURE_2D);
    }
  }
}
