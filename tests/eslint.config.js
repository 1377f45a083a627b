// Lints the web client and its tests; run from the repository root: that is the base of the paths.
import js from '@eslint/js';
import tseslint from 'typescript-eslint';

export default tseslint.config(
  { ignores: ['**/node_modules/**', '**/dist/**', '**/generated/**', 'build*/**'] },
  {
    files: ['web_client/**/*.ts', 'tests/**/*.ts'],
    extends: [js.configs.recommended, ...tseslint.configs.strictTypeChecked],
    languageOptions: {
      parserOptions: {
        project: ['web_client/tsconfig.json', 'tests/tsconfig.json'],
        tsconfigRootDir: process.cwd(),
      },
    },
    rules: {
      '@typescript-eslint/explicit-module-boundary-types': 'error',
      '@typescript-eslint/restrict-template-expressions': ['error', { allowNumber: true }],
      // `list[i]!` in loops over known lengths; anywhere else the type checker asks for a test.
      '@typescript-eslint/no-non-null-assertion': 'off',
      // Arrow functions that hand on a void call are how listeners are written here.
      '@typescript-eslint/no-confusing-void-expression': 'off',
      eqeqeq: 'error',
      'no-console': ['error', { allow: ['warn', 'error'] }],
      'max-lines': ['error', 450],
      'max-lines-per-function': ['error', { max: 70, skipBlankLines: true }],
    },
  },
  {
    files: ['tests/**/*.test.ts'],
    rules: { 'max-lines-per-function': 'off', 'no-console': 'off' }, // tests report figures
  },
);
