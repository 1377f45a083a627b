export const camera_modes = ['orbit', 'fly', 'walk'] as const;
export type CameraMode = (typeof camera_modes)[number];
