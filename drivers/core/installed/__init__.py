"""What is installed beside the program: packages of extras, and plug-ins."""
