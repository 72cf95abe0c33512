"""Events: CloudEvents about tags, stored durably."""
