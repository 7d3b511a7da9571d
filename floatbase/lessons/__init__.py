"""What the lessons share: controls that do not block the kernel, and exercises that check themselves."""
