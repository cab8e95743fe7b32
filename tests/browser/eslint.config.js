// What a type check does not see in the sources of the pages and in the tests that use them or the emulator.

import js from '@eslint/js';
import globals from 'globals';

const MARKUP = 'Names of documents are text: use textContent.';

export default [
  js.configs.recommended,
  {
    linterOptions: { reportUnusedDisableDirectives: 'error' },
    rules: {
      eqeqeq: 'error',
      'array-callback-return': 'error',
      'no-eval': 'error',
      'no-implicit-coercion': 'error',
      'no-implied-eval': 'error',
      'no-new-func': 'error',
      'no-script-url': 'error',
      'no-unmodified-loop-condition': 'error',
      'no-use-before-define': ['error', { functions: false, classes: false, variables: false }],
      'no-var': 'error',
      'object-shorthand': 'error',
      'prefer-const': ['error', { destructuring: 'all' }],
      'prefer-template': 'error',
    },
  },
  // The pages' modules are joined into one, so a name that is used twice is a trap.
  {
    files: ['host/**/*.js'],
    languageOptions: { globals: globals.browser },
    rules: {
      'no-shadow': 'error',
      'no-restricted-properties': ['error', ...['innerHTML', 'outerHTML', 'insertAdjacentHTML', 'write'].map((property) => ({ property, message: MARKUP }))],
    },
  },
  { files: ['host/measure/**/*.js'], languageOptions: { sourceType: 'script' } },
  // A function that a test hands to a page runs there.
  { files: ['tests/**'], languageOptions: { globals: { ...globals.node, ...globals.browser } } },
];
