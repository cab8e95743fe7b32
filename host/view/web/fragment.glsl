#version 300 es
// The renderer of `render.rs`, pixel by pixel: the ray through the pixel, its place on the sheet, the weights there, and
// the curves under each light.
precision highp float;
precision highp int;
precision highp sampler2DArray;
precision highp usampler2D;
precision highp usampler2DArray;

const int LIT = 0, DIFFERENCE = 1, STACKS = 2, PASS = 3;
const int MOST_LIGHTS = 4;

uniform int mode;
uniform vec2 picture;       // pixels
uniform vec3 corner, right, up, towards, eye;
uniform bool near;
uniform float curl;         // radius in metres, 0 is flat
uniform vec2 sheet;         // metres

uniform int lights;
uniform vec4 light[MOST_LIGHTS];  // direction or place, and 1 for near
uniform bool surrounded;
uniform float exposure;
uniform float knee;         // share of white
uniform vec3 ground;        // linear

uniform sampler2DArray weights;   // four weights a layer
uniform ivec2 mapSize;
uniform int channels;
uniform sampler2D curves;         // one row a curve
uniform int steps;
uniform sampler2DArray field;     // what each curve sends to the eye from all around, a layer a curve

uniform bool hasDots;
uniform usampler2DArray dots;     // tiles
uniform ivec2 dotSize;
uniform int tile;
uniform sampler2D colours;        // linear, a texel a stack
uniform sampler2D difference;
uniform uint pass;                // bits of the passes to show
uniform usampler2D passes;        // bits of each stack
uniform vec3 passColour;

out vec4 colour;

vec3 curveAt(int k, float chord) {
  float x = clamp(chord * 0.70710678, 0.0, 1.0) * float(steps - 1);
  int i = min(int(x), steps - 2);
  return mix(texelFetch(curves, ivec2(i, k), 0).rgb, texelFetch(curves, ivec2(i + 1, k), 0).rgb, x - float(i));
}

// E cos_i and the chord between normal and half vector; no light if it is behind the sheet.
vec2 irradiance(vec4 l, vec3 at, vec3 n, vec3 v) {
  vec3 to = l.xyz;
  float falloff = 1.0;
  if (l.w > 0.5) {
    to = l.xyz - at;
    float square = dot(to, to);
    falloff = dot(l.xyz, l.xyz) / square;
    to *= inversesqrt(square);
  }
  float c = dot(n, to);
  if (c <= 0.0) return vec2(0.0);
  return vec2(falloff * c, length(normalize(to + v) - n));
}

float bent(float v) {
  float over = v - knee, room = 1.0 - knee;
  return over <= 0.0 ? v : knee + room * over / (over + room);
}

// The tone curve of `tone.rs`.
vec3 shown(vec3 rgb) {
  rgb = max(rgb * exposure, 0.0);
  float most = max(rgb.r, max(rgb.g, rgb.b));
  if (most <= knee) return rgb;
  return 0.5 * (rgb * bent(most) / most + vec3(bent(rgb.r), bent(rgb.g), bent(rgb.b)));
}

vec3 coded(vec3 v) {
  v = clamp(v, 0.0, 1.0);
  return mix(12.92 * v, 1.055 * pow(v, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, v));
}

// Dark blue, green, yellow: even steps look even.
vec3 heat(float t) {
  t = clamp(t, 0.0, 1.0);
  const vec3 c0 = vec3(0.2777, 0.0054, 0.3341), c1 = vec3(0.1051, 1.4046, 1.3846), c2 = vec3(-0.3309, 0.2148, 0.0951),
    c3 = vec3(-4.6342, -5.7991, -19.3324), c4 = vec3(6.2283, 14.1799, 56.6906), c5 = vec3(4.7764, -13.7451, -65.3530),
    c6 = vec3(-5.4355, 4.6459, 26.3124);
  return c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * (c5 + t * c6)))));
}

int dotAt(vec2 uv) {
  ivec2 p = clamp(ivec2(floor(uv * vec2(dotSize))), ivec2(0), dotSize - 1);
  ivec2 t = p / tile;
  int across = (dotSize.x + tile - 1) / tile;
  return int(texelFetch(dots, ivec3(p - t * tile, t.y * across + t.x), 0).r);
}

bool covers(int stack) { return (texelFetch(passes, ivec2(stack, 0), 0).r & pass) != 0u; }

// What a curve or a stack counts as in this view.
vec3 valueOf(int k, vec2 e[MOST_LIGHTS], vec2 at) {
  if (mode == STACKS) return texelFetch(colours, ivec2(k, 0), 0).rgb;
  if (mode == PASS) return covers(k) ? passColour : vec3(0.93);
  vec3 sum = vec3(0.0);
  for (int i = 0; i < MOST_LIGHTS; i++) {
    if (i < lights && e[i].x > 0.0) sum += e[i].x * curveAt(k, e[i].y);
  }
  if (surrounded) {
    vec2 nodes = vec2(textureSize(field, 0).xy);
    sum += textureLod(field, vec3((at * (nodes - 1.0) + 0.5) / nodes, float(k)), 0.0).rgb;
  }
  return sum;
}

void main() {
  vec2 pixel = vec2(gl_FragCoord.x, picture.y - gl_FragCoord.y);
  vec3 window = corner + pixel.x * right - pixel.y * up;
  vec3 o = near ? eye : window;
  vec3 d = near ? window - eye : -towards;
  vec3 behind = coded(ground);
  colour = vec4(behind, 1.0);

  float t;
  vec3 n = vec3(0.0, 0.0, 1.0);
  vec2 place;
  if (curl > 0.0) {
    float a = d.x * d.x + d.z * d.z;
    float b = o.x * d.x + o.z * d.z + curl * d.z;
    float c = o.x * o.x + o.z * o.z + 2.0 * o.z * curl;
    float square = b * b - a * c;
    if (square < 0.0 || a == 0.0) return;
    float root = sqrt(square);
    t = b < 0.0 ? c / (root - b) : (-b - root) / a;
    vec2 p = vec2(o.x + t * d.x, o.z + t * d.z + curl);
    n = vec3(p.x, 0.0, p.y) / curl;
    place.x = curl * atan(p.x, p.y);
  } else {
    t = -o.z / d.z;
    place.x = o.x + t * d.x;
  }
  place.y = o.y + t * d.y;
  float facing = dot(n, d);
  if ((near && t <= 0.0) || facing >= 0.0) return;

  // A step in the picture, moved along the ray into the tangent plane.
  float scale = near ? t : 1.0;
  vec3 ex = right * scale, ey = -up * scale;
  ex -= d * (dot(n, ex) / facing);
  ey -= d * (dot(n, ey) / facing);
  vec2 sx = vec2(ex.x * n.z - ex.z * n.x, ex.y), sy = vec2(ey.x * n.z - ey.z * n.x, ey.y);
  vec2 width = min(sqrt(sx * sx + sy * sy), 0.05 * sheet);
  vec2 inside = clamp((0.5 * sheet - abs(place)) / max(width, 1e-12) + 0.5, 0.0, 1.0);
  float covered = inside.x * inside.y;
  if (covered <= 0.0) return;
  place = clamp(place, -0.5 * sheet, 0.5 * sheet);
  vec2 at = vec2(place.x / sheet.x + 0.5, 0.5 - place.y / sheet.y);

  vec3 v = near ? -normalize(d) : towards;
  vec2 e[MOST_LIGHTS];
  for (int i = 0; i < MOST_LIGHTS; i++) {
    e[i] = i < lights ? irradiance(light[i], o + t * d, n, v) : vec2(0.0);
  }

  vec3 sum = vec3(0.0);
  vec2 perDot = vec2(dotSize) / sheet;
  float dotsAcross = max(length(sx * perDot), length(sy * perDot));
  if (mode == DIFFERENCE) {
    sum = heat(textureLod(difference, at, 0.0).r * 0.51 / 0.2);
  } else if (hasDots && dotsAcross < 2.0) {
    // Dots as they are: the mean of sixteen places of the pixel.
    for (int j = 0; j < 16; j++) {
      vec2 part = (vec2(j & 3, j >> 2) + 0.5) * 0.25 - 0.5;
      vec2 move = sx * part.x + sy * part.y;
      vec2 uv = clamp(at + vec2(move.x, -move.y) / sheet, 0.0, 1.0);
      sum += valueOf(dotAt(uv), e, at) / 16.0;
    }
  } else {
    vec2 perPlace = vec2(mapSize) / sheet;
    vec2 px = sx * perPlace, py = sy * perPlace;
    float footprint = max(dot(px, px), dot(py, py));
    float lod = footprint > 1.0 ? 0.5 * log2(footprint) : 0.0;
    float total = 0.0;
    for (int group = 0; group * 4 < channels; group++) {
      vec4 w = textureLod(weights, vec3(at, float(group)), lod);
      for (int i = 0; i < 4; i++) {
        int k = group * 4 + i;
        if (k < channels && w[i] > 0.0) {
          sum += w[i] * valueOf(k, e, at);
          total += w[i];
        }
      }
    }
    sum /= max(total, 1e-6);
  }
  vec3 seen = mode == LIT ? shown(sum) : mode == DIFFERENCE ? pow(clamp(sum, 0.0, 1.0), vec3(2.2)) : sum;
  colour = vec4(coded(mix(ground, seen, covered)), 1.0);
}
