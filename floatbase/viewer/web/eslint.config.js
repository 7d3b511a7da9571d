import js from "@eslint/js";
import globals from "globals";

const rules = {
  ...js.configs.recommended.rules,
  eqeqeq: "error",
  "no-var": "error",
  "prefer-const": ["error", {destructuring: "all"}],
  "max-len": ["error", {code: 100}],
  "max-lines": ["error", {max: 400}],
};

export default [
  {ignores: ["dist/"]},
  {linterOptions: {reportUnusedDisableDirectives: "error"}},
  {files: ["src/**/*.js"], languageOptions: {globals: globals.browser}, rules},
  {files: ["*.mjs", "*.js", "test/**/*.js"], languageOptions: {globals: globals.node}, rules},
];
