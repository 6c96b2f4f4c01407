/** Says that what stands around here depends on signals: reading their values is what counts. */
export function reads(..._values: readonly unknown[]): void {
  // Nothing is done with them.
}
